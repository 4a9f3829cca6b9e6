#pragma once

#include <string>

/// Saving so that what exists stays, and what is new is whole or not there.
namespace fdi_lio {

/// `path`, or the first of path_2, path_3, ... that does not exist.
std::string free_path(const std::string& path);

/// `path`, or when that exists the free one of `path` with the local date and time, as map_20260131_235959.
std::string free_dated_path(const std::string& path);

/// Makes sure that the file or folder is on the disk, and not only on its way. Throws Error when it cannot
/// be.
void flush_to_disk(const std::string& path);

/// Gives what was written at `temporary` its name. Throws Error when `path` exists: nothing is replaced.
void rename_to_new(const std::string& temporary, const std::string& path);

}  // namespace fdi_lio
