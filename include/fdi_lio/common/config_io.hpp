#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"

namespace fdi_lio {

/// Reads `path` (YAML; `include: [file, ...]` relative to it is read first and overridden) and then
/// `overrides`
/// (`key=value`). Throws Error that lists every unknown key, wrong type and value out of range with
/// parameter, file and what is allowed. An empty path gives the defaults.
Config load_config(const std::string& path, const std::vector<std::string>& overrides);

/// Every parameter as used, as YAML that `load_config` reads back.
void write_config(Config config, std::ostream& out);

/// Markdown table of every parameter: name, default, unit, range, meaning. docs/parameters.md is this text.
void write_parameter_table(std::ostream& out);

}  // namespace fdi_lio
