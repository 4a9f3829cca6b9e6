#include "simulate_options.hpp"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::tools {

namespace {

const char kUsage[] =
    "usage: simulate_bag --scenario config/scenarios/NAME.yaml --output FILE.bag [--seed N] [--duration "
    "SECONDS]\n"
    "                    [--set key=value]... [--threads N] [--noise-seed N]\n"
    "                    [--revisit SECONDS [--reversed yes]]\n"
    "Writes FILE.bag (/points_raw /imu_raw /ground_truth/odometry, /gps/fix if enabled), and beside it "
    "FILE.tum (truth), "
    "FILE.labels\n"
    "(moving object of each point), FILE.yaml (what was drawn), FILE.config.yaml (parameters for fdi_lio).\n";

long whole_number(const std::string& name, const std::string& text, long min, long max) {
  char* end = nullptr;
  errno = 0;
  const long value = std::strtol(text.c_str(), &end, 10);
  if (text.empty() || *end != '\0' || errno != 0 || value < min || value > max) {
    throw Error(name + " '" + text + "' must be a whole number from " + std::to_string(min) + " to " +
                std::to_string(max));
  }
  return value;
}

}  // namespace

SimulateOptions parse_simulate_options(int argc, char** argv) {
  SimulateOptions options;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--help" || name == "-h") {
      std::cout << kUsage;
      std::exit(0);
    }
    if (i + 1 >= argc) throw Error("'" + name + "' is unknown or lacks its value\n" + kUsage);
    const std::string value = argv[++i];
    if (name == "--scenario")
      options.scenario = value;
    else if (name == "--output")
      options.output = value;
    else if (name == "--seed")
      options.seed = static_cast<std::uint64_t>(whole_number(name, value, 0, 2147483647));
    else if (name == "--noise-seed")
      options.noise_seed = static_cast<std::uint64_t>(whole_number(name, value, 0, 2147483647));
    else if (name == "--revisit")
      options.revisit_s = static_cast<double>(whole_number(name, value, 0, 7200));
    else if (name == "--reversed")
      options.reversed = value == "yes";
    else if (name == "--duration")
      options.overrides.push_back("duration=" + value);
    else if (name == "--set")
      options.overrides.push_back(value);
    else if (name == "--threads")
      options.threads = static_cast<int>(whole_number(name, value, 1, 256));
    else
      throw Error("unknown option '" + name + "'\n" + kUsage);
  }
  if (options.scenario.empty() || options.output.empty())
    throw Error(std::string("--scenario and --output are needed\n") + kUsage);
  if (std::filesystem::path(options.output).extension() != ".bag")
    throw Error("--output '" + options.output + "' must end in .bag");
  return options;
}

}  // namespace fdi_lio::tools
