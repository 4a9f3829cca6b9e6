#include <filesystem>
#include <map>
#include <ostream>
#include <set>

#include <yaml-cpp/yaml.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/simulation/scenario.hpp"

namespace fdi_lio::simulation {

namespace {

using Values = std::map<std::string, YAML::Node>;

void flatten(const YAML::Node& node, const std::string& prefix, Values* values) {
  for (const auto& item : node) {
    const std::string key = prefix + item.first.as<std::string>();
    if (item.second.IsMap()) {
      flatten(item.second, key + ".", values);
    } else {
      (*values)[key] = item.second;
    }
  }
}

/// Files may build on another one: `base: street.yaml`, relative to the file.
void read_file(const std::filesystem::path& path, int depth, Values* values) {
  if (depth > 5) throw Error("scenarios build on each other in a circle: " + path.string());
  if (!std::filesystem::is_regular_file(path)) {
    throw Error("unknown scenario '" + path.string() +
                "': no such file; the shipped ones lie in config/scenarios");
  }
  try {
    YAML::Node root = YAML::LoadFile(path.string());
    if (root.IsNull()) return;
    if (!root.IsMap()) throw Error("the scenario " + path.string() + " must be a map of settings");
    if (const YAML::Node base = root["base"]) {
      read_file(path.parent_path() / base.as<std::string>(), depth + 1, values);
      root.remove("base");
    }
    flatten(root, "", values);
  } catch (const YAML::Exception& error) {
    throw Error("the scenario " + path.string() + " is not valid YAML: " + error.what());
  }
}

void read_override(const std::string& text, Values* values) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Error("--set '" + text + "' is not of the form key=value");
  try {
    (*values)[text.substr(0, equals)] = YAML::Load(text.substr(equals + 1));
  } catch (const YAML::Exception& error) {
    throw Error("--set '" + text + "' has no valid value: " + error.what());
  }
}

/// Takes values and collects every error.
class Reader : public ParameterVisitor {
 public:
  explicit Reader(const Values& values) : values_(values) {}

  void real(const ParameterInfo& info, double& value, double min, double max) override {
    number(info, value, min, max, "a number");
  }
  void integer(const ParameterInfo& info, int& value, int min, int max) override {
    number(info, value, min, max, "a whole number");
  }
  void flag(const ParameterInfo& info, bool& value) override { take(info, "true or false", &value); }
  void text(const ParameterInfo& info, std::string& value) override { take(info, "a text", &value); }

  void choice(const ParameterInfo& info, std::string& value,
              const std::vector<std::string>& choices) override {
    std::string read;
    if (!take(info, "a text", &read)) return;
    std::string allowed;
    for (const std::string& choice : choices) {
      if (read == choice) value = read;
      allowed += (allowed.empty() ? "" : ", ") + choice;
    }
    if (value != read) errors_.push_back("unknown " + info.name + " '" + read + "', allowed are: " + allowed);
  }

  void vector3(const ParameterInfo& info, Eigen::Vector3d& value) override {
    std::vector<double> read;
    if (!take(info, "three numbers", &read)) return;
    if (read.size() != 3) return errors_.push_back("'" + info.name + "' must be three numbers");
    value = Eigen::Vector3d(read[0], read[1], read[2]);
  }

  void rotation(const ParameterInfo& info, Eigen::Quaterniond& value) override {
    std::vector<double> read;
    if (!take(info, "a quaternion x y z w", &read)) return;
    const bool four = read.size() == 4;
    const Eigen::Quaterniond q = four ? Eigen::Quaterniond(read[3], read[0], read[1], read[2]) : value;
    if (!four || !(std::abs(q.norm() - 1.0) < 1e-3)) {
      return errors_.push_back("'" + info.name + "' must be a quaternion x y z w of norm 1");
    }
    value = q.normalized();
  }

  void finish() const {
    std::vector<std::string> errors = errors_;
    for (const auto& [name, node] : values_) {
      if (known_.count(name) == 0) errors.push_back("unknown key '" + name + "'");
    }
    if (errors.empty()) return;
    std::string text = std::to_string(errors.size()) + " error(s) in the scenario:";
    for (const std::string& error : errors) text += "\n  - " + error;
    throw Error(text + "\nEvery key is listed in docs/simulator.md.");
  }

 private:
  template <typename T>
  void number(const ParameterInfo& info, T& value, T min, T max, const std::string& expected) {
    T read{};
    if (!take(info, expected, &read)) return;
    if (read >= min && read <= max) {
      value = read;
      return;
    }
    errors_.push_back("'" + info.name + "' is " + std::to_string(read) + " " + info.unit + ", allowed is " +
                      std::to_string(min) + " to " + std::to_string(max));
  }

  template <typename T>
  bool take(const ParameterInfo& info, const std::string& expected, T* value) {
    known_.insert(info.name);
    const auto found = values_.find(info.name);
    if (found == values_.end()) return false;
    try {
      *value = found->second.as<T>();
      return true;
    } catch (const YAML::Exception&) {
      errors_.push_back("'" + info.name + "' must be " + expected);
      return false;
    }
  }

  const Values& values_;
  std::set<std::string> known_;
  std::vector<std::string> errors_;
};

/// Builds a YAML tree from the dotted names.
class Writer : public ParameterVisitor {
 public:
  void real(const ParameterInfo& info, double& value, double, double) override { put(info, value); }
  void integer(const ParameterInfo& info, int& value, int, int) override { put(info, value); }
  void flag(const ParameterInfo& info, bool& value) override { put(info, value); }
  void text(const ParameterInfo& info, std::string& value) override { put(info, value); }
  void choice(const ParameterInfo& info, std::string& value, const std::vector<std::string>&) override {
    put(info, value);
  }
  void vector3(const ParameterInfo& info, Eigen::Vector3d& value) override {
    put(info, std::vector<double>{value.x(), value.y(), value.z()});
  }
  void rotation(const ParameterInfo& info, Eigen::Quaterniond& value) override {
    put(info, std::vector<double>{value.x(), value.y(), value.z(), value.w()});
  }

  std::string text() const {
    YAML::Emitter emitter;
    emitter.SetDoublePrecision(12);
    emitter << root_;
    return emitter.c_str();
  }

 private:
  /// Names have up to three parts: group.name or group.subgroup.name.
  template <typename T>
  void put(const ParameterInfo& info, const T& value) {
    const std::size_t dot = info.name.find('.');
    if (dot == std::string::npos) {
      root_[info.name] = value;
      return;
    }
    YAML::Node group = root_[info.name.substr(0, dot)];
    const std::string rest = info.name.substr(dot + 1);
    const std::size_t second = rest.find('.');
    if (second == std::string::npos) {
      group[rest] = value;
    } else {
      group[rest.substr(0, second)][rest.substr(second + 1)] = value;
    }
  }

  YAML::Node root_{YAML::NodeType::Map};
};

}  // namespace

Scenario load_scenario(const std::string& path, const std::vector<std::string>& overrides) {
  Values values;
  read_file(path, 0, &values);
  for (const std::string& text : overrides) read_override(text, &values);
  Reader reader(values);
  Scenario scenario;
  scenario.visit(reader);
  reader.finish();
  return scenario;
}

void write_scenario(Scenario scenario, std::ostream& out, int indent) {
  Writer writer;
  scenario.visit(writer);
  const std::string margin(static_cast<std::size_t>(indent), ' ');
  std::string line = margin;
  for (const char c : writer.text() + "\n") {
    line += c;
    if (c != '\n') continue;
    out << line;
    line = margin;
  }
}

}  // namespace fdi_lio::simulation
