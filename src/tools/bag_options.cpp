#include "bag_options.hpp"

#include <cstdlib>
#include <iostream>
#include <sstream>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::tools {

namespace {

double parse_seconds(const std::string& name, const std::string& text) {
  std::size_t used = 0;
  double value = -1.0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != text.size() || text.empty() || !(value >= 0.0)) {
    throw Error(name + " is '" + text + "', must be a number of seconds of 0 or more");
  }
  return value;
}

std::vector<double> parse_pose(const std::string& text) {
  std::istringstream in(text);
  std::vector<double> numbers;
  for (double number = 0.0; in >> number;) numbers.push_back(number);
  if (numbers.size() != 3 || !in.eof())
    throw Error("--initial-pose is '" + text + "', must be 'x y yaw' in metres and degrees");
  return numbers;
}

}  // namespace

BagOptions parse_bag_options(int argc, char** argv, const std::string& usage, bool has_output) {
  BagOptions options;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    const auto value = [&]() -> const std::string& {
      if (i + 1 >= arguments.size()) throw Error(name + " needs a value\n" + usage);
      return arguments[++i];
    };
    if (name == "--config") {
      options.config = value();
    } else if (name == "--bag") {
      options.bags.push_back(value());
      while (i + 1 < arguments.size() && arguments[i + 1].rfind("--", 0) != 0)
        options.bags.push_back(arguments[++i]);
    } else if (name == "--output" && has_output) {
      options.output = value();
    } else if (name == "--localise" && has_output) {
      options.overrides.push_back("localisation.session=" + value());
    } else if (name == "--initial-pose" && has_output) {
      options.initial_pose = parse_pose(value());
    } else if (name == "--set") {
      options.overrides.push_back(value());
    } else if (name == "--start") {
      options.start_s = parse_seconds(name, value());
    } else if (name == "--duration") {
      options.duration_s = parse_seconds(name, value());
    } else if (name == "--help" || name == "-h") {
      std::cout << usage;
      std::exit(0);
    } else {
      throw Error("unknown argument '" + name + "'\n" + usage);
    }
  }
  if (options.config.empty() || options.bags.empty() || (has_output && options.output.empty())) {
    throw Error(std::string(has_output ? "--config, --bag and --output" : "--config and --bag") +
                " are needed\n" + usage);
  }
  return options;
}

}  // namespace fdi_lio::tools
