#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace fdi_lio {

/// A number for each of many 64-bit keys. An open hash table, several times faster than std::unordered_map
/// for voxels, whose places in memory can be asked for before they are needed.
class KeyIndex {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// Number of `key`; the next of 0, 1, 2, ... if it was not seen before and none was erased.
  std::uint32_t find_or_add(std::uint64_t key) { return find_or_add(key, size_); }

  /// Number of `key`, which is `number` from now on if it had none.
  std::uint32_t find_or_add(std::uint64_t key, std::uint32_t number) {
    if (2 * (size_ + 1) > slots_.size()) grow();
    Slot& slot = slots_[slot_of(key)];
    if (slot.number == kNone) {
      slot = {key, number};
      ++size_;
    }
    return slot.number;
  }

  /// Number of `key`, or kNone.
  std::uint32_t find(std::uint64_t key) const { return size_ == 0 ? kNone : slots_[slot_of(key)].number; }

  /// Asks for the memory that `find` will look at.
  void prefetch(std::uint64_t key) const {
    if (size_ > 0) __builtin_prefetch(&slots_[home_of(key)]);
  }

  void erase(std::uint64_t key) {
    if (find(key) == kNone) return;
    const std::size_t mask = slots_.size() - 1;
    std::size_t hole = slot_of(key);
    // What was put farther along because of this one moves up.
    for (std::size_t at = (hole + 1) & mask; slots_[at].number != kNone; at = (at + 1) & mask) {
      if (((at - home_of(slots_[at].key)) & mask) < ((at - hole) & mask)) continue;
      slots_[hole] = slots_[at];
      hole = at;
    }
    slots_[hole] = Slot();
    --size_;
  }

  /// Forgets all keys and keeps the memory.
  void clear() {
    if (size_ > 0) std::fill(slots_.begin(), slots_.end(), Slot());
    size_ = 0;
  }

  /// Keys with a number.
  std::size_t size() const { return size_; }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t number = kNone;
  };

  std::size_t home_of(std::uint64_t key) const {
    const std::uint64_t mixed = key * 0x9E3779B97F4A7C15ULL;  // Fibonacci hashing
    return static_cast<std::size_t>(mixed >> 32U) & (slots_.size() - 1);
  }

  /// Slot that holds the key, or is free for it.
  std::size_t slot_of(std::uint64_t key) const {
    std::size_t at = home_of(key);
    while (slots_[at].number != kNone && slots_[at].key != key) at = (at + 1) & (slots_.size() - 1);
    return at;
  }

  void grow() {
    std::vector<Slot> before(slots_.empty() ? kLeastSlots : 2 * slots_.size());
    before.swap(slots_);
    for (const Slot& slot : before) {
      if (slot.number != kNone) slots_[slot_of(slot.key)] = slot;
    }
  }

  static constexpr std::size_t kLeastSlots = 1024;

  std::vector<Slot> slots_;  ///< a power of two of them
  std::uint32_t size_ = 0;
};

}  // namespace fdi_lio
