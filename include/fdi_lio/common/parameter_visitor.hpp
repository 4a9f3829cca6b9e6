#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fdi_lio {

/// Name, unit and meaning of one parameter. The name is the full path in the YAML file
/// (`mapping.window_size`).
struct ParameterInfo {
  std::string name;
  std::string unit;
  std::string meaning;
};

/// The one declaration of a parameter is a call of these functions in a `Config::visit`. The default is the
/// value that the member has in a newly made config. Loader, writer and documentation are visitors.
class ParameterVisitor {
 public:
  virtual ~ParameterVisitor() = default;

  virtual void real(const ParameterInfo& info, double& value, double min, double max) = 0;
  virtual void integer(const ParameterInfo& info, int& value, int min, int max) = 0;
  virtual void flag(const ParameterInfo& info, bool& value) = 0;
  virtual void text(const ParameterInfo& info, std::string& value) = 0;
  virtual void choice(const ParameterInfo& info, std::string& value,
                      const std::vector<std::string>& choices) = 0;
  virtual void vector3(const ParameterInfo& info, Eigen::Vector3d& value) = 0;
  /// Four numbers x y z w, or nine numbers of a rotation matrix row by row.
  virtual void rotation(const ParameterInfo& info, Eigen::Quaterniond& value) = 0;
};

}  // namespace fdi_lio
