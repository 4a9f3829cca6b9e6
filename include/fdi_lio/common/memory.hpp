#pragma once

namespace fdi_lio {

/// For the main function of a program that works on scan after scan: memory of one scan is kept for the next
/// one instead of being given back to the system in between, which would clear and map it again ten times a
/// second. Up to 512 MB that are free at the end of the heap stay with the program.
void keep_freed_memory();

}  // namespace fdi_lio
