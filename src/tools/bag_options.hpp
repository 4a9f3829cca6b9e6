#pragma once

#include <string>
#include <vector>

namespace fdi_lio::tools {

/// The command line of a tool that reads recordings.
struct BagOptions {
  std::string config;
  std::vector<std::string> bags;
  std::string output;
  std::vector<std::string> overrides;  ///< `key=value`
  double start_s = 0.0;
  double duration_s = 0.0;           ///< 0: to the end
  std::vector<double> initial_pose;  ///< x y [m] yaw [deg] in the session to localise in; empty: not given
};

/// Reads --config, --bag, --set, --start, --duration, and if `has_output` --output, --localise (which sets
/// localisation.session) and --initial-pose. Prints `usage` and exits
/// with --help. Throws Error, which ends with `usage`, when something is unknown or missing.
BagOptions parse_bag_options(int argc, char** argv, const std::string& usage, bool has_output);

}  // namespace fdi_lio::tools
