#include "fdi_lio/mapping/session_io.hpp"

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include <fcntl.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/evaluation/trajectory_writer.hpp"
#include "fdi_lio/mapping/cloud_file.hpp"
#include "fdi_lio/mapping/map_builder.hpp"
#include "fdi_lio/version.hpp"

namespace fdi_lio::mapping {

namespace {

namespace fs = std::filesystem;

const char* const kIndex = "session.yaml";
const char* const kFormat = "fdi_lio session";
constexpr int kFormatVersion = 1;

std::string cloud_name(std::size_t keyframe) {
  char name[64];
  std::snprintf(name, sizeof(name), "keyframes/%06zu.pcd", keyframe);
  return name;
}

/// FNV-1a, 64 bits, of a file: finds damage, not malice.
std::string checksum(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  std::vector<char> buffer(1 << 16);
  while (in) {
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    for (std::streamsize k = 0; k < in.gcount(); ++k) {
      hash ^= static_cast<unsigned char>(buffer[static_cast<std::size_t>(k)]);
      hash *= 0x100000001b3ULL;
    }
  }
  char text[17];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

/// Makes sure that what was written is on the disk, and not only on its way.
void flush_to_disk(const fs::path& path) {
  const int file = open(path.c_str(), O_RDONLY);
  const bool is_done = file >= 0 && fsync(file) == 0;
  if (file >= 0) close(file);
  if (!is_done) throw Error("cannot write " + path.string() + " to the disk: check free space");
}

std::vector<std::string> session_files(std::size_t keyframes) {
  std::vector<std::string> names = {"graph.g2o", "trajectory.tum", "odometry.tum", "trajectory_kitti.txt",
                                    "map.pcd"};
  for (std::size_t k = 0; k < keyframes; ++k) names.push_back(cloud_name(k));
  return names;
}

void write_kitti(const GlobalOptimizer& global, const fs::path& path) {
  std::ofstream out(path);
  out.precision(12);
  for (std::size_t k = 0; k < global.size(); ++k) {
    const Eigen::Matrix4d T = global.T_map_imu(k).matrix();
    for (int cell = 0; cell < 12; ++cell) out << (cell == 0 ? "" : " ") << T(cell / 4, cell % 4);
    out << '\n';
  }
  out.close();
  if (!out) throw Error("cannot write " + path.string() + ": check free space and permission");
}

void write_index(std::size_t keyframes, const fs::path& folder) {
  YAML::Emitter yaml;
  yaml << YAML::BeginMap << YAML::Key << "format" << YAML::Value << kFormat << YAML::Key << "format_version"
       << YAML::Value << kFormatVersion << YAML::Key << "program_version" << YAML::Value << kVersion
       << YAML::Key << "keyframes" << YAML::Value << keyframes << YAML::Key << "files" << YAML::Value
       << YAML::BeginMap;
  for (const std::string& name : session_files(keyframes)) {
    flush_to_disk(folder / name);
    yaml << YAML::Key << name << YAML::Value << YAML::Flow << YAML::BeginSeq << fs::file_size(folder / name)
         << checksum(folder / name) << YAML::EndSeq;
  }
  yaml << YAML::EndMap << YAML::EndMap;
  std::ofstream out(folder / kIndex);
  out << yaml.c_str() << '\n';
  out.close();
  if (!out) throw Error("cannot write " + (folder / kIndex).string() + ": check free space and permission");
  flush_to_disk(folder / kIndex);
}

void write_files(const GlobalOptimizer& global, double map_voxel_m, const fs::path& folder) {
  write_g2o((folder / "graph.g2o").string(), global.graph());
  evaluation::TrajectoryWriter corrected((folder / "trajectory.tum").string());
  evaluation::TrajectoryWriter odometry((folder / "odometry.tum").string());
  MapBuilder map(map_voxel_m);
  for (std::size_t k = 0; k < global.size(); ++k) {
    const Eigen::Isometry3d T_map_imu = global.T_map_imu(k);
    const Eigen::Isometry3d& T_odom_imu = global.T_odom_imu(k);
    corrected.add(global.stamp(k), Eigen::Quaterniond(T_map_imu.linear()), T_map_imu.translation());
    odometry.add(global.stamp(k), Eigen::Quaterniond(T_odom_imu.linear()), T_odom_imu.translation());
    const auto cloud = global.cloud(k);
    map.add(cloud->surface, T_map_imu);
    write_keyframe_pcd((folder / cloud_name(k)).string(), *cloud);
  }
  write_kitti(global, folder / "trajectory_kitti.txt");
  map.write_pcd((folder / "map.pcd").string());
  write_index(global.size(), folder);
}

struct StampedPose {
  Stamp stamp;
  Eigen::Isometry3d T;
};

std::vector<StampedPose> read_tum(const fs::path& path) {
  std::ifstream in(path);
  std::vector<StampedPose> poses;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    long long seconds = 0;
    long long nanoseconds = 0;
    char point = 0;
    Eigen::Vector3d t;
    Eigen::Quaterniond q;
    fields >> seconds >> point >> nanoseconds >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
    if (!fields) throw Error(path.string() + " has a line that is no pose: " + line);
    poses.push_back({seconds * 1000000000LL + nanoseconds, Eigen::Isometry3d::Identity()});
    poses.back().T.linear() = q.normalized().toRotationMatrix();
    poses.back().T.translation() = t;
  }
  return poses;
}

YAML::Node read_index(const fs::path& folder) {
  const std::string path = (folder / kIndex).string();
  if (!fs::is_directory(folder))
    throw Error("the session " + folder.string() + " is no folder: check the path");
  if (!fs::exists(path)) throw Error(folder.string() + " is no session: it has no " + kIndex);
  YAML::Node index;
  try {
    index = YAML::LoadFile(path);
    if (index["format"].as<std::string>() != kFormat) throw Error(path + " is not the index of a session");
    if (index["format_version"].as<int>() != kFormatVersion)
      throw Error(path + " has format version " + index["format_version"].as<std::string>() +
                  ", this program reads " + std::to_string(kFormatVersion));
  } catch (const YAML::Exception& error) {
    throw Error(path + " cannot be read (" + error.what() + "): the session is damaged or foreign");
  }
  return index;
}

}  // namespace

std::string free_session_path(const std::string& path) {
  std::string free = path;
  for (int number = 2; fs::exists(free); ++number) free = path + "_" + std::to_string(number);
  return free;
}

void save_session(const GlobalOptimizer& global, double map_voxel_m, const std::string& path) {
  if (fs::exists(path)) throw Error(path + " exists already: nothing was saved; choose another name");
  // What a save that was cut short left stays, for it may be somebody else's.
  const fs::path part = free_session_path(path + ".part");
  std::error_code error;
  fs::create_directories(part / "keyframes", error);
  if (error) throw Error("cannot make the folder " + part.string() + ": " + error.message());
  try {
    write_files(global, map_voxel_m, part);
    flush_to_disk(part);
  } catch (const Error&) {
    fs::remove_all(part, error);
    throw;
  }
  // Unlike std::filesystem::rename this fails also on an empty folder that was made meanwhile.
  if (renameat2(AT_FDCWD, part.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE) != 0)
    throw Error("cannot rename " + part.string() + " to " + path +
                ": the session stays under the first name");
}

Session load_session(const std::string& path) {
  const fs::path folder(path);
  const YAML::Node index = read_index(folder);
  Session session;
  session.path = path;
  std::size_t keyframes = 0;
  try {
    keyframes = index["keyframes"].as<std::size_t>();
    for (const std::string& name : session_files(keyframes)) {
      const YAML::Node entry = index["files"][name];
      if (!entry) throw Error((folder / kIndex).string() + " does not list " + name);
      if (!fs::exists(folder / name)) throw Error("the session " + path + " lacks " + name);
      if (fs::file_size(folder / name) != entry[0].as<std::uintmax_t>() ||
          checksum(folder / name) != entry[1].as<std::string>())
        throw Error("the session " + path + " is damaged: " + name + " is not what was saved");
    }
  } catch (const YAML::Exception& error) {
    throw Error((folder / kIndex).string() + " cannot be read (" + error.what() + ")");
  }
  session.graph = read_g2o((folder / "graph.g2o").string());
  const std::vector<StampedPose> odometry = read_tum(folder / "odometry.tum");
  if (odometry.size() != keyframes || session.graph.poses.size() != keyframes)
    throw Error("the session " + path + " has not the same number of keyframes in all files");
  for (std::size_t k = 0; k < keyframes; ++k)
    session.keyframes.push_back({odometry[k].stamp, odometry[k].T, session.graph.poses[k]});
  return session;
}

KeyframeCloud load_session_cloud(const Session& session, std::size_t keyframe) {
  return read_keyframe_pcd((fs::path(session.path) / cloud_name(keyframe)).string());
}

}  // namespace fdi_lio::mapping
