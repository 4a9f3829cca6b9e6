#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "synthetic_places.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/new_file.hpp"
#include "fdi_lio/mapping/session_io.hpp"

namespace fdi_lio::mapping {
namespace {

namespace fs = std::filesystem;

class Sessions : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("fdi_lio_session_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    path_ = (folder_ / "save").string();
    const SyntheticWorld town = make_town(1);
    for (int k = 0; k < 5; ++k) {
      Keyframe keyframe;
      keyframe.stamp = 1700000000123456789LL + 1000000000LL * k;
      keyframe.T_odom_imu = planar_pose(2.0 * k, 0.1 * k, 0.05 * k);
      keyframe.covariance = 1e-6 * Matrix6d::Identity();
      keyframe.cloud = town.seen_from(keyframe.T_odom_imu, static_cast<unsigned>(k));
      keyframe.cloud.edges.assign(3, keyframe.cloud.planes.front());
      global_.add(keyframe);
    }
  }
  void TearDown() override { fs::remove_all(folder_); }

  void save(const std::string& path) { save_session(global_, options_, path); }

  static std::string error_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  fs::path folder_;
  std::string path_;
  SessionOptions options_;
  Reporter reporter_;
  GlobalOptimizer global_{Config(), &reporter_};
};

TEST_F(Sessions, WhatIsSavedIsLoadedBack) {
  save(path_);
  const Session session = load_session(path_);
  ASSERT_EQ(session.keyframes.size(), 5U);
  ASSERT_EQ(session.graph.odometry.size(), 4U);
  EXPECT_EQ(session.keyframes[3].stamp, global_.stamp(3));
  EXPECT_TRUE(session.keyframes[3].T_odom_imu.isApprox(global_.T_odom_imu(3), 1e-8));
  EXPECT_TRUE(session.keyframes[3].T_map_imu.isApprox(global_.T_map_imu(3), 1e-12));
  const KeyframeCloud cloud = load_session_cloud(session, 3);
  ASSERT_EQ(cloud.planes.size(), global_.cloud(3)->planes.size());
  EXPECT_EQ(cloud.edges.size(), 3U);
  EXPECT_EQ(cloud.planes[7].position, global_.cloud(3)->planes[7].position);
  EXPECT_FALSE(fs::exists(path_ + ".part"));
  ASSERT_EQ(session.places.size(), 5U);
  EXPECT_EQ(session.descriptor_range_m, Config().loop.descriptor_range_m);
  const PlaceDescriptor place = describe_place(
      cloud.surface, levelled(session.keyframes[3].T_odom_imu.linear()), session.descriptor_range_m);
  EXPECT_TRUE((session.places[3].height == place.height).all());
  EXPECT_TRUE((session.places[3].ring_key == place.ring_key).all());
}

TEST_F(Sessions, MapsOfEachKindOfFeatureAndInEachFormat) {
  options_.map_format = CloudFormat::kPly;
  options_.layers = true;
  save(path_);
  for (const char* name : {"map.ply", "map_planes.ply", "map_edges.ply"})
    EXPECT_GT(fs::file_size(path_ + "/" + name), 100U) << name;
  EXPECT_FALSE(fs::exists(path_ + "/map.pcd"));
  // Three equal edge points in each of five keyframes make no more than five voxels of 16 bytes.
  EXPECT_LT(fs::file_size(path_ + "/map_edges.ply"), 300U);
  EXPECT_EQ(load_session(path_).keyframes.size(), 5U);
  std::ofstream(path_ + "/map_edges.ply", std::ios::app) << "more";
  EXPECT_THAT(error_of([this] { load_session(path_); }), testing::HasSubstr("map_edges.ply"));
}

TEST_F(Sessions, DatedNamesStayInTheFolderAndKeepTheEnding) {
  EXPECT_EQ(free_dated_path(path_), path_);
  save(path_);
  const std::string dated = free_dated_path(path_);
  EXPECT_THAT(dated, testing::StartsWith(path_ + "_20"));
  EXPECT_EQ(dated.size(), path_.size() + 16);
  save(dated);
  EXPECT_THAT(free_dated_path(path_ + "/trajectory.tum"), testing::EndsWith(".tum"));
}

TEST_F(Sessions, WhatExistsIsNotTouched) {
  fs::create_directories(path_);
  std::ofstream(path_ + "/mine.txt") << "important";
  EXPECT_THAT(error_of([this] { save(path_); }), testing::HasSubstr("exists already"));
  EXPECT_EQ(fs::file_size(path_ + "/mine.txt"), 9U);
  EXPECT_EQ(free_path(path_), path_ + "_2");
  save(free_path(path_));
  EXPECT_EQ(free_path(path_), path_ + "_3");
  EXPECT_EQ(load_session(path_ + "_2").keyframes.size(), 5U);
}

TEST_F(Sessions, DamageIsNamed) {
  save(path_);
  for (const std::string name :
       {"graph.g2o", "keyframes/000002.pcd", "map.pcd", "odometry.tum", "places.bin"}) {
    const std::string copy = path_ + "_damaged";
    fs::copy(path_, copy, fs::copy_options::recursive);
    std::fstream file(copy + "/" + name, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(300);
    const auto byte = static_cast<char>(file.get());
    file.seekp(300);
    file.put(static_cast<char>(byte ^ 1));
    file.close();
    EXPECT_THAT(error_of([&] { load_session(copy); }), testing::HasSubstr(name));
    fs::remove(copy + "/" + name);
    EXPECT_THAT(error_of([&] { load_session(copy); }), testing::HasSubstr("lacks " + name));
    fs::remove_all(copy);
  }
}

TEST_F(Sessions, ForeignFoldersAreRejected) {
  EXPECT_THAT(error_of([this] { load_session(path_); }), testing::HasSubstr("no folder"));
  fs::create_directories(path_);
  EXPECT_THAT(error_of([this] { load_session(path_); }), testing::HasSubstr("no session.yaml"));
  for (const char* text : {"format: other\n", "[", "", "a: 1\n"}) {
    std::ofstream(path_ + "/session.yaml") << text;
    EXPECT_NE(error_of([this] { load_session(path_); }), "no error") << text;
  }
  std::ofstream(path_ + "/session.yaml") << "format: fdi_lio session\nformat_version: 99\n";
  EXPECT_THAT(error_of([this] { load_session(path_); }), testing::HasSubstr("version 99"));
}

TEST_F(Sessions, TargetThatCannotBeMadeIsNamed) {
  std::ofstream(folder_ / "file") << "in the way";
  EXPECT_THAT(error_of([this] { save((folder_ / "file/below").string()); }),
              testing::HasSubstr("file/below"));
}

/// Runs `action` in a process of its own and returns how that ended.
int status_of_child(const std::function<void()>& action) {
  const pid_t child = fork();
  if (child == 0) {
    action();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

TEST_F(Sessions, FullDiskLeavesTheEarlierSaveWhole) {
  save(path_);
  // A limit on the size of files ends writing as a full disk does, with an error from write().
  const int status = status_of_child([this] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{20000, 20000};
    setrlimit(RLIMIT_FSIZE, &limit);
    const std::string error = error_of([this] { save(path_ + "_new"); });
    _exit(error.find("free space") != std::string::npos ? 42 : 1);
  });
  EXPECT_EQ(WEXITSTATUS(status), 42);
  EXPECT_FALSE(fs::exists(path_ + "_new"));
  EXPECT_FALSE(fs::exists(path_ + "_new.part"));
  EXPECT_EQ(load_session(path_).keyframes.size(), 5U);
}

TEST_F(Sessions, KillLeavesTheEarlierSaveWholeAndTheNextSaveWorks) {
  save(path_);
  // The limit's signal ends the process in the middle of a file, with no chance to tidy up.
  const int status = status_of_child([this] {
    std::signal(SIGXFSZ, SIG_DFL);
    const rlimit limit{20000, 20000};
    setrlimit(RLIMIT_FSIZE, &limit);
    save(path_ + "_new");
  });
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(fs::exists(path_ + "_new"));
  EXPECT_TRUE(fs::exists(path_ + "_new.part"));
  EXPECT_EQ(load_session(path_).keyframes.size(), 5U);
  save(path_ + "_new");
  EXPECT_EQ(load_session(path_ + "_new").keyframes.size(), 5U);
}

}  // namespace
}  // namespace fdi_lio::mapping
