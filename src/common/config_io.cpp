#include "fdi_lio/common/config_io.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <ostream>
#include <set>
#include <sstream>

#include <yaml-cpp/yaml.h>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio {

namespace {

/// A value with where it was written, for messages.
struct Entry {
  YAML::Node value;
  std::string where;
};
using Entries = std::map<std::string, Entry>;

void flatten(const YAML::Node& node, const std::string& prefix, const std::string& file, Entries* entries) {
  for (const auto& item : node) {
    const std::string key =
        prefix.empty() ? item.first.as<std::string>() : prefix + "." + item.first.as<std::string>();
    if (item.second.IsMap()) {
      flatten(item.second, key, file, entries);
    } else {
      (*entries)[key] = {item.second, file + ":" + std::to_string(item.second.Mark().line + 1)};
    }
  }
}

YAML::Node parse_file(const std::filesystem::path& path) {
  try {
    return YAML::LoadFile(path.string());
  } catch (const YAML::BadFile&) {
    throw Error("cannot read the configuration " + path.string() +
                ": check the path (what an include names is looked for beside the file that includes it)");
  } catch (const YAML::Exception& error) {
    throw Error("the configuration " + path.string() + " is not valid YAML: " + error.what());
  }
}

void read_file(const std::filesystem::path& path, int depth, Entries* entries) {
  if (depth > 8) throw Error("configurations include each other: " + path.string());
  YAML::Node root = parse_file(path);
  if (root.IsNull()) return;
  if (!root.IsMap()) throw Error("the configuration " + path.string() + " must be a map of parameters");
  if (const YAML::Node includes = root["include"]) {
    for (const auto& include : includes) {
      read_file(path.parent_path() / include.as<std::string>(), depth + 1, entries);
    }
    root.remove("include");
  }
  flatten(root, "", path.string(), entries);
}

void read_override(const std::string& text, Entries* entries) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw Error("the override '" + text + "' is not of the form key=value");
  }
  try {
    (*entries)[text.substr(0, equals)] = {YAML::Load(text.substr(equals + 1)), "override '" + text + "'"};
  } catch (const YAML::Exception& error) {
    throw Error("the override '" + text + "' has no valid value: " + error.what());
  }
}

std::string number_text(double value) {
  std::ostringstream out;
  out.precision(15);
  out << value;
  return out.str();
}

/// Takes values out of the entries and collects every error.
class Reader : public ParameterVisitor {
 public:
  explicit Reader(Entries entries) : entries_(std::move(entries)) {}

  void real(const ParameterInfo& info, double& value, double min, double max) override {
    double read = 0.0;
    if (!take(info, "a number", &read)) return;
    if (!(read >= min && read <= max))
      return out_of_range(info, number_text(read), number_text(min), number_text(max));
    value = read;
  }

  void integer(const ParameterInfo& info, int& value, int min, int max) override {
    int read = 0;
    if (!take(info, "a whole number", &read)) return;
    if (read < min || read > max) {
      return out_of_range(info, std::to_string(read), std::to_string(min), std::to_string(max));
    }
    value = read;
  }

  void flag(const ParameterInfo& info, bool& value) override { take(info, "true or false", &value); }

  void text(const ParameterInfo& info, std::string& value) override { take(info, "a text", &value); }

  void choice(const ParameterInfo& info, std::string& value,
              const std::vector<std::string>& choices) override {
    std::string read;
    if (!take(info, "a text", &read)) return;
    std::string allowed;
    for (const std::string& choice : choices) {
      if (read == choice) {
        value = read;
        return;
      }
      allowed += (allowed.empty() ? "" : ", ") + choice;
    }
    errors_.push_back(where(info) + " is '" + read + "', allowed are: " + allowed);
  }

  void vector3(const ParameterInfo& info, Eigen::Vector3d& value) override {
    std::vector<double> read;
    if (!take(info, "three numbers", &read)) return;
    if (read.size() != 3 || !all_finite(read)) {
      errors_.push_back(where(info) + " must be three finite numbers");
      return;
    }
    value = Eigen::Vector3d(read[0], read[1], read[2]);
  }

  void rotation(const ParameterInfo& info, Eigen::Quaterniond& value) override {
    constexpr double kTolerance = 1e-3;  // what four printed decimals can miss
    std::vector<double> read;
    if (!take(info, "4 or 9 numbers", &read)) return;
    if (read.size() == 4 && all_finite(read)) {
      const Eigen::Quaterniond q(read[3], read[0], read[1], read[2]);
      if (std::abs(q.norm() - 1.0) > kTolerance) {
        errors_.push_back(where(info) + " is a quaternion x y z w of norm " + number_text(q.norm()) +
                          ", must be 1");
        return;
      }
      value = q.normalized();
      return;
    }
    if (read.size() == 9 && all_finite(read)) {
      const Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(read.data());
      const double defect = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
      if (defect > kTolerance || R.determinant() < 0.0) {
        errors_.push_back(where(info) + " is no rotation: determinant " + number_text(R.determinant()) +
                          " (must be +1), largest entry of R^T R - I " + number_text(defect) +
                          " (must be 0)");
        return;
      }
      value = Eigen::Quaterniond(R).normalized();
      return;
    }
    errors_.push_back(where(info) +
                      " must be a quaternion x y z w or nine matrix entries row by row, all finite");
  }

  void finish() {
    for (const auto& [name, entry] : entries_) {
      if (known_.count(name) == 0) errors_.push_back("unknown parameter '" + name + "' in " + entry.where);
    }
    if (errors_.empty()) return;
    std::string text = std::to_string(errors_.size()) + " error(s) in the configuration:";
    for (const std::string& error : errors_) text += "\n  - " + error;
    throw Error(text + "\nEvery parameter with its range is listed in docs/parameters.md.");
  }

 private:
  static bool all_finite(const std::vector<double>& values) {
    for (const double value : values) {
      if (!std::isfinite(value)) return false;
    }
    return true;
  }

  std::string where(const ParameterInfo& info) const {
    return "parameter '" + info.name + "' in " + entries_.at(info.name).where;
  }

  void out_of_range(const ParameterInfo& info, const std::string& value, const std::string& min,
                    const std::string& max) {
    errors_.push_back(where(info) + " is " + value + (info.unit.empty() ? "" : " " + info.unit) +
                      ", allowed is " + min + " to " + max);
  }

  template <typename T>
  bool take(const ParameterInfo& info, const std::string& expected, T* value) {
    known_.insert(info.name);
    const auto entry = entries_.find(info.name);
    if (entry == entries_.end()) return false;
    try {
      *value = entry->second.value.as<T>();
      return true;
    } catch (const YAML::Exception&) {
      errors_.push_back(where(info) + " must be " + expected);
      return false;
    }
  }

  Entries entries_;
  std::set<std::string> known_;
  std::vector<std::string> errors_;
};

std::string vector_text(const Eigen::Vector3d& v) {
  return "[" + number_text(v.x()) + ", " + number_text(v.y()) + ", " + number_text(v.z()) + "]";
}

std::string quaternion_text(const Eigen::Quaterniond& q) {
  return "[" + number_text(q.x()) + ", " + number_text(q.y()) + ", " + number_text(q.z()) + ", " +
         number_text(q.w()) + "]";
}

/// Hands each parameter on as text.
class TextVisitor : public ParameterVisitor {
 public:
  void real(const ParameterInfo& info, double& value, double min, double max) override {
    line(info, number_text(value), number_text(min) + " to " + number_text(max));
  }
  void integer(const ParameterInfo& info, int& value, int min, int max) override {
    line(info, std::to_string(value), std::to_string(min) + " to " + std::to_string(max));
  }
  void flag(const ParameterInfo& info, bool& value) override {
    line(info, value ? "true" : "false", "true, false");
  }
  void text(const ParameterInfo& info, std::string& value) override {
    line(info, "\"" + value + "\"", "text");
  }
  void choice(const ParameterInfo& info, std::string& value,
              const std::vector<std::string>& choices) override {
    std::string allowed;
    for (const std::string& choice : choices) allowed += (allowed.empty() ? "" : ", ") + choice;
    line(info, "\"" + value + "\"", allowed);
  }
  void vector3(const ParameterInfo& info, Eigen::Vector3d& value) override {
    line(info, vector_text(value), "finite");
  }
  void rotation(const ParameterInfo& info, Eigen::Quaterniond& value) override {
    line(info, quaternion_text(value), "rotation");
  }

 protected:
  virtual void line(const ParameterInfo& info, const std::string& value, const std::string& range) = 0;
};

class YamlWriter : public TextVisitor {
 public:
  explicit YamlWriter(std::ostream& out) : out_(out) {}

 protected:
  void line(const ParameterInfo& info, const std::string& value, const std::string& /*range*/) override {
    root_[info.name] = value;
  }

 public:
  /// Nested by the dots of the names.
  void write() {
    std::vector<std::string> open;
    for (const auto& [name, value] : root_) {
      std::vector<std::string> parts;
      std::istringstream stream(name);
      for (std::string part; std::getline(stream, part, '.');) parts.push_back(part);
      std::size_t common = 0;
      while (common < open.size() && common + 1 < parts.size() && open[common] == parts[common]) ++common;
      open.resize(common);
      for (std::size_t level = common; level + 1 < parts.size(); ++level) {
        out_ << std::string(2 * level, ' ') << parts[level] << ":\n";
        open.push_back(parts[level]);
      }
      out_ << std::string(2 * (parts.size() - 1), ' ') << parts.back() << ": " << value << "\n";
    }
  }

 private:
  std::ostream& out_;
  std::map<std::string, std::string> root_;
};

class TableWriter : public TextVisitor {
 public:
  explicit TableWriter(std::ostream& out) : out_(out) {}

 protected:
  void line(const ParameterInfo& info, const std::string& value, const std::string& range) override {
    out_ << "| `" << info.name << "` | " << value << " | " << info.unit << " | " << range << " | "
         << info.meaning << " |\n";
  }

 private:
  std::ostream& out_;
};

}  // namespace

Config load_config(const std::string& path, const std::vector<std::string>& overrides) {
  Entries entries;
  if (!path.empty()) read_file(path, 0, &entries);
  for (const std::string& text : overrides) read_override(text, &entries);
  Reader reader(std::move(entries));
  Config config;
  config.visit(reader);
  reader.finish();
  return config;
}

void write_config(Config config, std::ostream& out) {
  YamlWriter writer(out);
  config.visit(writer);
  writer.write();
}

void write_parameter_table(std::ostream& out) {
  out << "| parameter | default | unit | allowed | meaning |\n|---|---|---|---|---|\n";
  TableWriter writer(out);
  Config config;
  config.visit(writer);
}

}  // namespace fdi_lio
