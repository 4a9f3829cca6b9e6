#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace fdi_lio::tools {

/// What simulate_bag was asked for.
struct SimulateOptions {
  std::string scenario;
  std::string output;
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> noise_seed;  ///< of the sensors' errors; empty: the same
  std::optional<double> revisit_s;  ///< another drive, from where the first one is then; empty: the first one
  bool reversed = false;            ///< the other drive goes back
  int threads = 0;
  std::vector<std::string> overrides;
};

/// Reads the arguments. Prints the usage and ends the program when asked for help; throws Error when an
/// option is unknown, lacks its value or is out of range.
SimulateOptions parse_simulate_options(int argc, char** argv);

}  // namespace fdi_lio::tools
