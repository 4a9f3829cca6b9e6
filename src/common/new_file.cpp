#include "fdi_lio/common/new_file.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>

#include <fcntl.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio {

namespace fs = std::filesystem;

std::string free_path(const std::string& path) {
  std::string free = path;
  for (int number = 2; fs::exists(fs::symlink_status(free)); ++number)
    free = path + "_" + std::to_string(number);
  return free;
}

std::string free_dated_path(const std::string& path) {
  if (!fs::exists(fs::symlink_status(path))) return path;
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char date[32];
  std::strftime(date, sizeof(date), "_%Y%m%d_%H%M%S", &local);
  const fs::path old(path);
  return free_path((old.parent_path() / (old.stem().string() + date + old.extension().string())).string());
}

void flush_to_disk(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY);
  const bool is_done = file >= 0 && fsync(file) == 0;
  if (file >= 0) close(file);
  if (!is_done) throw Error("cannot write " + path + " to the disk: check free space");
}

void rename_to_new(const std::string& temporary, const std::string& path) {
  // Unlike rename() this fails also on an empty folder that was made meanwhile.
  int result = renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE);
  // Some network file systems do not know how to.
  if (result != 0 && errno == EINVAL && !fs::exists(fs::symlink_status(path)))
    result = std::rename(temporary.c_str(), path.c_str());
  if (result != 0)
    throw Error("cannot rename " + temporary + " to " + path + " (" + std::strerror(errno) +
                "): what was saved stays under the first name");
  const fs::path parent = fs::path(path).parent_path();
  flush_to_disk(parent.empty() ? "." : parent.string());
}

}  // namespace fdi_lio
