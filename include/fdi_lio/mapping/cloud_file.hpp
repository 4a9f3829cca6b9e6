#pragma once

#include <string>
#include <vector>

#include "fdi_lio/mapping/keyframe_store.hpp"

namespace fdi_lio::mapping {

enum class CloudFormat { kPcd, kPly };

/// `pcd` or `ply`, also the ending of the files. Throws Error for anything else.
CloudFormat to_cloud_format(const std::string& text);
const char* to_text(CloudFormat format);

/// Writes x y z intensity (float32, binary, little endian) beside `path` and renames it, so that an earlier
/// file stays whole until the new one is. Throws Error when the file cannot be written.
void write_cloud(const std::string& path, const std::vector<Point>& points, CloudFormat format);

/// Writes a binary PCD with x y z intensity layer (float32): layer 0 surface, 1 planes, 2 edges. Throws Error
/// when the file cannot be written.
void write_keyframe_pcd(const std::string& path, const KeyframeCloud& cloud);

/// Reads what `write_keyframe_pcd` wrote. Throws Error when the file is something else or cut short.
KeyframeCloud read_keyframe_pcd(const std::string& path);

}  // namespace fdi_lio::mapping
