#pragma once

#include <cstddef>

#include <tbb/parallel_for.h>

namespace fdi_lio {

/// Calls `body(begin, end, chunk)` for consecutive chunks of [0, count). The chunks depend on `count` and
/// `chunk_size` only, so that results which are stored per chunk and reduced in order are the same for any
/// number of threads.
template <typename Body>
void parallel_chunks(std::size_t count, std::size_t chunk_size, const Body& body) {
  const std::size_t chunks = (count + chunk_size - 1) / chunk_size;
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    const std::size_t begin = chunk * chunk_size;
    const std::size_t end = begin + chunk_size < count ? begin + chunk_size : count;
    body(begin, end, chunk);
  });
}

}  // namespace fdi_lio
