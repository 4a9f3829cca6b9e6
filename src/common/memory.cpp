#include "fdi_lio/common/memory.hpp"

#include <malloc.h>

namespace fdi_lio {

void keep_freed_memory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 512 << 20);
  // Few pools: what one thread frees another one uses.
  mallopt(M_ARENA_MAX, 2);
}

}  // namespace fdi_lio
