#pragma once

#include <cstddef>
#include <fstream>
#include <string>
#include <vector>

#include "fdi_lio/mapping/keyframe_store.hpp"

namespace fdi_lio::mapping {

enum class CloudFormat { kPcd, kPly };

/// `pcd` or `ply`, also the ending of the files. Throws Error for anything else.
CloudFormat to_cloud_format(const std::string& text);
const char* to_text(CloudFormat format);

/// A file of points x y z intensity (float32, binary, little endian) whose number is not known before all are
/// written. It is written beside `path` and renamed by `close`, so that an earlier file stays whole until the
/// new one is.
class CloudFile {
 public:
  CloudFile(const std::string& path, CloudFormat format);
  CloudFile(const CloudFile&) = delete;
  CloudFile& operator=(const CloudFile&) = delete;
  /// Without `close` before, nothing is left of the file.
  ~CloudFile();

  void add(const Point& point);

  /// Throws Error when the file, or any point of it, could not be written.
  void close();

 private:
  std::string path_;
  std::string temporary_;
  CloudFormat format_;
  std::ofstream out_;
  std::size_t count_ = 0;
};

/// Writes a binary PCD with x y z intensity layer (float32): layer 0 surface, 1 planes, 2 edges. Throws Error
/// when the file cannot be written.
void write_keyframe_pcd(const std::string& path, const KeyframeCloud& cloud);

/// Reads what `write_keyframe_pcd` wrote. Throws Error when the file is something else or cut short.
KeyframeCloud read_keyframe_pcd(const std::string& path);

}  // namespace fdi_lio::mapping
