#pragma once

namespace fdi_lio {

/// For the main function of a program that works on scan after scan: memory of one scan is kept for the next
/// one instead of being given back to the system in between, which would clear and map it again ten times a
/// second. Costs no more than the largest need of one scan.
void keep_freed_memory();

}  // namespace fdi_lio
