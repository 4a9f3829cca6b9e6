#pragma once

#include <string>

#include "fdi_lio/mapping/keyframe_store.hpp"

namespace fdi_lio::mapping {

/// Writes a binary PCD with x y z intensity layer (float32): layer 0 surface, 1 planes, 2 edges. Throws Error
/// when the file cannot be written.
void write_keyframe_pcd(const std::string& path, const KeyframeCloud& cloud);

/// Reads what `write_keyframe_pcd` wrote. Throws Error when the file is something else or cut short.
KeyframeCloud read_keyframe_pcd(const std::string& path);

}  // namespace fdi_lio::mapping
