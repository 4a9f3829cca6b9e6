#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "synthetic_places.hpp"
#include <gtest/gtest.h>
#include <unistd.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/localisation/localiser.hpp"
#include "fdi_lio/mapping/session_io.hpp"

namespace fdi_lio::localisation {
namespace {

/// Poses every metre along a straight way.
std::vector<Eigen::Isometry3d> straight(const Eigen::Isometry3d& begin, int count) {
  std::vector<Eigen::Isometry3d> way;
  for (int k = 0; k < count; ++k) way.push_back(begin * mapping::planar_pose(k, 0.0, 0.0));
  return way;
}

/// A session that was recorded in `world`, odometry and map being the world's frame, to be removed at the
/// end.
class SavedSession {
 public:
  SavedSession(const mapping::SyntheticWorld& world, const std::vector<Eigen::Isometry3d>& way) {
    Config config;
    config.loop.enabled = false;
    mapping::GlobalOptimizer global(config, &reporter_);
    for (std::size_t k = 0; k < way.size(); ++k) {
      mapping::Keyframe keyframe;
      keyframe.stamp = static_cast<Stamp>(1 + k);
      keyframe.T_odom_imu = way[k];
      keyframe.covariance = 1e-8 * Matrix6d::Identity();
      keyframe.cloud = world.seen_from(way[k], static_cast<unsigned>(k));
      global.add(std::move(keyframe));
    }
    static int number = 0;
    path_ = std::filesystem::temp_directory_path() /
            ("fdi_lio_localiser_" + std::to_string(getpid()) + "_" + std::to_string(++number));
    mapping::save_session(global, {}, path_.string());
  }
  ~SavedSession() { std::filesystem::remove_all(path_); }

  mapping::Session load() const { return mapping::load_session(path_.string()); }

 private:
  Reporter reporter_;
  std::filesystem::path path_;
};

/// A visit: scans at 2 m/s, with an odometry that begins somewhere and drifts.
class Visit {
 public:
  Visit(const mapping::SyntheticWorld& world, const Eigen::Isometry3d& T_odom_world,
        double yaw_drift_rad_per_m = 0.0)
      : world_(&world), T_odom_world_(T_odom_world), yaw_drift_(yaw_drift_rad_per_m) {}

  void enter(const mapping::SyntheticWorld& world) { world_ = &world; }

  mapping::Keyframe at(const Eigen::Isometry3d& T_world_imu) {
    if (count_ == 0) T_odom_imu_ = T_odom_world_ * T_world_imu;
    if (count_ > 0) {
      const Eigen::Isometry3d step = T_world_before_.inverse() * T_world_imu;
      T_odom_imu_ =
          T_odom_imu_ * step * mapping::planar_pose(0.0, 0.0, yaw_drift_ * step.translation().norm());
    }
    T_world_before_ = T_world_imu;
    mapping::Keyframe scan;
    scan.stamp = 1700000000LL * 1000000000LL + 500000000LL * count_;
    scan.T_odom_imu = T_odom_imu_;
    scan.cloud = world_->seen_from(T_world_imu, static_cast<unsigned>(1000 + count_));
    ++count_;
    return scan;
  }

 private:
  const mapping::SyntheticWorld* world_;
  Eigen::Isometry3d T_odom_world_;
  double yaw_drift_;
  Eigen::Isometry3d T_world_before_;
  Eigen::Isometry3d T_odom_imu_;
  int count_ = 0;
};

class Localisation : public testing::Test {
 protected:
  /// Length of the difference between where the localiser is and where it should be.
  static Vector6d error(const Localiser& localiser, const mapping::Keyframe& scan,
                        const Eigen::Isometry3d& T_world_imu) {
    return difference(T_world_imu, *localiser.T_map_odom() * scan.T_odom_imu);
  }

  const mapping::SyntheticWorld town_ = mapping::make_town(1);
  const std::vector<Eigen::Isometry3d> street_ = straight(mapping::planar_pose(25.0, -30.0, 0.5 * M_PI), 56);
  const SavedSession session_{town_, street_};
  Reporter reporter_;
};

class LocalisationStarts : public Localisation, public testing::WithParamInterface<double> {};

TEST_P(LocalisationStarts, FindsItselfAndNeverAtAWrongPlace) {
  Localiser localiser(Config(), session_.load(), &reporter_);
  // Beside the way of the session, with any heading, and an odometry that began elsewhere.
  const double heading = GetParam();
  Visit visit(town_, mapping::planar_pose(-70.0, 40.0, 2.0));
  int found = -1;
  for (int k = 0; k < 20; ++k) {
    const Eigen::Isometry3d T = mapping::planar_pose(25.0 + 0.7, -10.0 + k, heading);
    const mapping::Keyframe scan = visit.at(T);
    localiser.add(scan);
    if (!localiser.T_map_odom()) continue;
    if (found < 0) found = k;
    EXPECT_LT(error(localiser, scan, T).tail<3>().norm(), 0.15) << k;
    EXPECT_LT(error(localiser, scan, T).head<3>().norm(), 0.01) << k;
  }
  EXPECT_EQ(localiser.state(), LocalisationState::kTracking);
  // Two confirmations, a second and more apart: not with the first scan, but within ten seconds.
  EXPECT_GT(found, 2);
  EXPECT_LT(found, 20);
}

INSTANTIATE_TEST_SUITE_P(Headings, LocalisationStarts, testing::Values(0.5 * M_PI, -0.5 * M_PI, 0.3, -2.5));

TEST_F(Localisation, IsNeverFoundInAnotherTown) {
  for (unsigned seed = 2; seed < 5; ++seed) {
    const mapping::SyntheticWorld other = mapping::make_town(seed);
    Localiser localiser(Config(), session_.load(), &reporter_);
    Visit visit(other, mapping::planar_pose(0.0, 0.0, 0.0));
    for (const Eigen::Isometry3d& T : street_) localiser.add(visit.at(T));
    EXPECT_FALSE(localiser.T_map_odom()) << seed;
    EXPECT_NE(localiser.state(), LocalisationState::kTracking) << seed;
  }
}

/// A hall of pillars that are all alike, with `spots` of its own on the same surfaces.
mapping::SyntheticWorld make_hall(unsigned spots) {
  mapping::SyntheticWorld hall(spots);
  hall.add({-100.0, -3.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 6.0, 0.0}, 10.0);
  hall.add({-100.0, -3.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 0.0, 4.0}, 50.0);
  hall.add({-100.0, 3.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 0.0, 4.0}, 50.0);
  for (double x = -98.4; x < 99.0; x += 3.2) {
    hall.add_box(x, -3.0, 1.0, 0.8, 4.0, 50.0, 12.0);
    hall.add_box(x, 2.2, 1.0, 0.8, 4.0, 50.0, 12.0);
  }
  return hall;
}

TEST_F(Localisation, IsNotBelievedAtAWrongPlaceOfAHallThatRepeatsItself) {
  const std::vector<Eigen::Isometry3d> way = straight(mapping::planar_pose(-30.0, 0.0, 0.0), 60);
  const SavedSession saved(make_hall(1), way);
  const mapping::SyntheticWorld hall = make_hall(2);
  // In the part that the session knows, and in one just like it that it does not.
  for (const double begin : {-20.0, 50.0}) {
    Localiser localiser(Config(), saved.load(), &reporter_);
    Visit visit(hall, mapping::planar_pose(5.0, 5.0, 1.0));
    for (int k = 0; k < 24; ++k) {
      const Eigen::Isometry3d T = mapping::planar_pose(begin + k, 0.0, 0.0);
      const mapping::Keyframe scan = visit.at(T);
      localiser.add(scan);
      if (!localiser.T_map_odom()) continue;
      EXPECT_LT(error(localiser, scan, T).tail<3>().norm(), 0.3) << begin + k;
    }
  }
}

TEST_F(Localisation, BeginsAtTheInitialPose) {
  Localiser localiser(Config(), session_.load(), &reporter_);
  const Eigen::Isometry3d begin = street_[20];
  InitialPose pose;
  pose.x_m = begin.translation().x() + 1.5;
  pose.y_m = begin.translation().y() - 1.0;
  pose.yaw_rad = 0.5 * M_PI + 0.3;
  localiser.set_initial_pose(pose);
  Visit visit(town_, mapping::planar_pose(3.0, 4.0, -1.0));
  mapping::Keyframe scan;
  for (std::size_t k = 20; k < 32; ++k) {
    scan = visit.at(street_[k]);
    localiser.add(scan);
  }
  ASSERT_EQ(localiser.state(), LocalisationState::kTracking);
  EXPECT_LT(error(localiser, scan, street_[31]).tail<3>().norm(), 0.1);
}

TEST_F(Localisation, AWrongInitialPoseIsNotBelieved) {
  Localiser localiser(Config(), session_.load(), &reporter_);
  InitialPose pose;
  pose.x_m = street_[50].translation().x();
  pose.y_m = street_[50].translation().y();
  pose.yaw_rad = 0.5 * M_PI;
  localiser.set_initial_pose(pose);
  Visit visit(town_, mapping::planar_pose(0.0, 0.0, 0.0));
  for (std::size_t k = 5; k < 50; ++k) {
    const mapping::Keyframe scan = visit.at(street_[k]);
    localiser.add(scan);
    if (!localiser.T_map_odom()) continue;
    EXPECT_LT(error(localiser, scan, street_[k]).tail<3>().norm(), 0.2) << k;
  }
  // The search by what places look like takes over.
  EXPECT_EQ(localiser.state(), LocalisationState::kTracking);
}

TEST_F(Localisation, CorrectsAnOdometryThatDrifts) {
  Localiser localiser(Config(), session_.load(), &reporter_);
  // After 45 m the odometry alone would be 1 m off.
  Visit visit(town_, mapping::planar_pose(0.0, 0.0, 0.0), 0.001);
  mapping::Keyframe scan;
  for (std::size_t k = 5; k < 50; ++k) {
    scan = visit.at(street_[k]);
    const auto result = localiser.add(scan);
    if (!result || result->registration.verdict != mapping::LoopVerdict::kAccepted || !localiser.T_map_odom())
      continue;
    EXPECT_LT(error(localiser, scan, street_[k]).tail<3>().norm(), 0.1) << k;
  }
  EXPECT_EQ(localiser.state(), LocalisationState::kTracking);
}

TEST_F(Localisation, SaysThatItIsLostAndRecovers) {
  Localiser localiser(Config(), session_.load(), &reporter_);
  const mapping::SyntheticWorld other = mapping::make_town(7);
  Visit visit(town_, mapping::planar_pose(1.0, 2.0, 3.0));
  const auto state_after = [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) localiser.add(visit.at(street_[k]));
    return localiser.state();
  };
  EXPECT_EQ(state_after(0, 15), LocalisationState::kTracking);
  visit.enter(other);
  EXPECT_EQ(state_after(15, 35), LocalisationState::kLost);
  visit.enter(town_);
  EXPECT_EQ(state_after(35, 56), LocalisationState::kTracking);
  EXPECT_EQ(reporter_.notices().at("localisation_lost").count, 1U);
}

}  // namespace
}  // namespace fdi_lio::localisation
