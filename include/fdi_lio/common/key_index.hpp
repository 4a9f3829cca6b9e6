#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace fdi_lio {

/// Numbers 64-bit keys 0, 1, 2, ... in the order in which they are first seen. An open hash table, several
/// times faster than std::unordered_map for the voxels of a scan.
class KeyIndex {
 public:
  /// Number of `key`; a new one if it was not seen before.
  std::uint32_t find_or_add(std::uint64_t key) {
    if (2 * (size_ + 1) > slots_.size()) grow();
    Slot& slot = slots_[find(key)];
    if (slot.number == kFree) slot = {key, size_++};
    return slot.number;
  }

  /// Forgets all keys and keeps the memory.
  void clear() {
    if (size_ > 0) std::fill(slots_.begin(), slots_.end(), Slot());
    size_ = 0;
  }

  /// Keys seen.
  std::size_t size() const { return size_; }

 private:
  static constexpr std::uint32_t kFree = 0xFFFFFFFFU;

  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t number = kFree;
  };

  /// Slot that holds the key, or is free for it.
  std::size_t find(std::uint64_t key) const {
    const std::size_t mask = slots_.size() - 1;
    const std::uint64_t mixed = key * 0x9E3779B97F4A7C15ULL;  // Fibonacci hashing
    std::size_t at = static_cast<std::size_t>(mixed >> 32U) & mask;
    while (slots_[at].number != kFree && slots_[at].key != key) at = (at + 1) & mask;
    return at;
  }

  void grow() { resize(slots_.empty() ? kLeastSlots : 2 * slots_.size()); }

  void resize(std::size_t slots) {
    std::vector<Slot> before(slots);
    before.swap(slots_);
    for (const Slot& slot : before) {
      if (slot.number != kFree) slots_[find(slot.key)] = slot;
    }
  }

  static constexpr std::size_t kLeastSlots = 1024;

  std::vector<Slot> slots_;  ///< a power of two of them
  std::uint32_t size_ = 0;
};

}  // namespace fdi_lio
