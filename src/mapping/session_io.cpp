#include "fdi_lio/mapping/session_io.hpp"

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/new_file.hpp"
#include "fdi_lio/evaluation/trajectory_writer.hpp"
#include "fdi_lio/mapping/cloud_file.hpp"
#include "fdi_lio/mapping/map_file.hpp"
#include "fdi_lio/version.hpp"

namespace fdi_lio::mapping {

namespace {

namespace fs = std::filesystem;

const char* const kIndex = "session.yaml";
const char* const kFormat = "fdi_lio session";
constexpr int kFormatVersion = 2;

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

/// Without these a session is none.
std::vector<std::string> needed_files(std::size_t keyframes) {
  std::vector<std::string> names = {"graph.g2o", "odometry.tum", "places.bin"};
  for (std::size_t k = 0; k < keyframes; ++k) names.push_back(cloud_name(k));
  return names;
}

/// Heights and intensities of the descriptors in single precision, one after the other, and the ring keys.
void write_places(const GlobalOptimizer& global, const fs::path& path) {
  std::ofstream out(path, std::ios::binary);
  for (std::size_t k = 0; k < global.size(); ++k) {
    const PlaceDescriptor& place = global.place(k);
    for (const PlaceDescriptor::KeptGrid* kept : {&place.height, &place.intensity}) {
      const PlaceDescriptor::Grid grid = kept->cast<float>();
      out.write(reinterpret_cast<const char*>(grid.data()), sizeof(grid));
    }
    out.write(reinterpret_cast<const char*>(place.ring_key.data()), sizeof(place.ring_key));
  }
  out.close();
  if (!out) throw Error("cannot write " + path.string() + ": check free space and permission");
}

Places read_places(std::size_t count, const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  Places places(count);
  for (PlaceDescriptor& place : places) {
    for (PlaceDescriptor::KeptGrid* kept : {&place.height, &place.intensity}) {
      PlaceDescriptor::Grid grid;
      in.read(reinterpret_cast<char*>(grid.data()), sizeof(grid));
      *kept = grid.cast<Eigen::half>();
    }
    in.read(reinterpret_cast<char*>(place.ring_key.data()), sizeof(place.ring_key));
  }
  if (!in || in.peek() != std::ifstream::traits_type::eof())
    throw Error(path.string() + " has not one descriptor for each keyframe");
  return places;
}

void write_index(const GlobalOptimizer& global, std::vector<std::string> names, const fs::path& folder) {
  for (std::size_t k = 0; k < global.size(); ++k) names.push_back(cloud_name(k));
  YAML::Emitter yaml;
  yaml << YAML::BeginMap << YAML::Key << "format" << YAML::Value << kFormat << YAML::Key << "format_version"
       << YAML::Value << kFormatVersion << YAML::Key << "program_version" << YAML::Value << kVersion
       << YAML::Key << "keyframes" << YAML::Value << global.size() << YAML::Key << "descriptor_range"
       << YAML::Value << global.descriptor_range_m() << YAML::Key << "files" << YAML::Value << YAML::BeginMap;
  for (const std::string& name : names) {
    flush_to_disk((folder / name).string());
    yaml << YAML::Key << name << YAML::Value << YAML::Flow << YAML::BeginSeq << fs::file_size(folder / name)
         << checksum(folder / name) << YAML::EndSeq;
  }
  yaml << YAML::EndMap << YAML::EndMap;
  std::ofstream out(folder / kIndex);
  out << yaml.c_str() << '\n';
  out.close();
  if (!out) throw Error("cannot write " + (folder / kIndex).string() + ": check free space and permission");
  flush_to_disk((folder / kIndex).string());
}

/// The keyframes' clouds, and the maps made of them; returns the names of the maps.
std::vector<std::string> write_clouds(const GlobalOptimizer& global, const SessionOptions& options,
                                      const fs::path& folder) {
  struct Layer {
    std::string name;
    std::vector<Point> KeyframeCloud::*points;
  };
  std::vector<Layer> layers = {{"map", &KeyframeCloud::surface}};
  if (options.layers) {
    layers.push_back({"map_planes", &KeyframeCloud::planes});
    layers.push_back({"map_edges", &KeyframeCloud::edges});
  }
  for (std::size_t k = 0; k < global.size(); ++k)
    write_keyframe_pcd((folder / cloud_name(k)).string(), *global.cloud(k));
  std::vector<std::string> names;
  for (const Layer& layer : layers) {
    names.push_back(layer.name + "." + to_text(options.map_format));
    write_map(map_source(global), layer.points,
              map_file_settings(global, options.map_voxel_m, options.map_format),
              (folder / names.back()).string());
  }
  return names;
}

void write_files(const GlobalOptimizer& global, const SessionOptions& options, const fs::path& folder) {
  std::vector<std::string> names = write_clouds(global, options, folder);
  write_g2o((folder / "graph.g2o").string(), global.graph());
  std::vector<evaluation::StampedPose> corrected;
  std::vector<evaluation::StampedPose> odometry;
  for (std::size_t k = 0; k < global.size(); ++k) {
    corrected.push_back({global.stamp(k), global.T_map_imu(k)});
    odometry.push_back({global.stamp(k), global.T_odom_imu(k)});
  }
  using evaluation::TrajectoryFormat;
  evaluation::write_trajectory((folder / "trajectory.tum").string(), corrected, TrajectoryFormat::kTum);
  evaluation::write_trajectory((folder / "odometry.tum").string(), odometry, TrajectoryFormat::kTum);
  evaluation::write_trajectory((folder / "trajectory_kitti.txt").string(), corrected,
                               TrajectoryFormat::kKitti);
  write_places(global, folder / "places.bin");
  names.insert(names.end(),
               {"graph.g2o", "trajectory.tum", "odometry.tum", "trajectory_kitti.txt", "places.bin"});
  write_index(global, names, folder);
}

std::vector<evaluation::StampedPose> read_tum(const fs::path& path) {
  std::ifstream in(path);
  std::vector<evaluation::StampedPose> poses;
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

/// Compares the files that the index lists with it.
void check_files(const YAML::Node& index, std::size_t keyframes, const fs::path& folder) {
  for (const std::string& name : needed_files(keyframes))
    if (!index["files"][name]) throw Error((folder / kIndex).string() + " does not list " + name);
  for (const auto& entry : index["files"]) {
    const std::string name = entry.first.as<std::string>();
    if (!fs::exists(folder / name)) throw Error("the session " + folder.string() + " lacks " + name);
    if (fs::file_size(folder / name) != entry.second[0].as<std::uintmax_t>() ||
        checksum(folder / name) != entry.second[1].as<std::string>())
      throw Error("the session " + folder.string() + " is damaged: " + name + " is not what was saved");
  }
}

}  // namespace

void save_session(const GlobalOptimizer& global, const SessionOptions& options, const std::string& path) {
  if (fs::exists(path)) throw Error(path + " exists already: nothing was saved; choose another name");
  // What a save that was cut short left stays, for it may be somebody else's.
  const fs::path part = free_path(path + ".part");
  std::error_code error;
  fs::create_directories(part / "keyframes", error);
  if (error) throw Error("cannot make the folder " + part.string() + ": " + error.message());
  try {
    write_files(global, options, part);
    flush_to_disk((part / "keyframes").string());
    flush_to_disk(part.string());
  } catch (const Error&) {
    fs::remove_all(part, error);
    throw;
  }
  rename_to_new(part.string(), path);
}

Session load_session(const std::string& path) {
  const fs::path folder(path);
  const YAML::Node index = read_index(folder);
  Session session;
  session.path = path;
  std::size_t keyframes = 0;
  try {
    keyframes = index["keyframes"].as<std::size_t>();
    session.descriptor_range_m = index["descriptor_range"].as<double>();
    if (keyframes == 0) throw Error("the session " + path + " has no keyframes");
    check_files(index, keyframes, folder);
  } catch (const YAML::Exception& error) {
    throw Error((folder / kIndex).string() + " cannot be read (" + error.what() + ")");
  }
  session.places = read_places(keyframes, folder / "places.bin");
  session.graph = read_g2o((folder / "graph.g2o").string());
  const std::vector<evaluation::StampedPose> odometry = read_tum(folder / "odometry.tum");
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
