#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/evaluation/stage_times.hpp"
#include "fdi_lio/evaluation/trajectory_writer.hpp"
#include "fdi_lio/localisation/localiser.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/pipeline/slam_pipeline.hpp"

namespace fdi_lio::pipeline {

/// Everything that a run leaves behind. What is complete at any moment stays when the run is cut short:
/// trajectories and tables grow line by line, the map is written when asked for.
class RunDirectory {
 public:
  /// Makes the folder `path` and opens its files; `run.yaml` is written at once. Throws Error when the folder
  /// cannot be made or written.
  RunDirectory(const std::string& path, const Config& config);

  /// Appends one scan to trajectory.tum, odometry.tum, degeneracy.csv, covariance.csv and directions.csv.
  /// States that the scan revises replace those of before in both trajectories. Throws Error when the disk
  /// takes no more.
  void add(const ScanOutput& output);

  /// Poses after global correction: trajectory.tum anew, map.pcd from the keyframes' clouds at `map_voxel_m`,
  /// loops.csv, and fixes.csv if there were any; when these have shown where the map lies, trajectory_enu.tum
  /// and georeference.yaml. Each trajectory is written under another name first and then renamed.
  void write_global(const mapping::GlobalOptimizer& global, double map_voxel_m) const;

  /// In place of `write_global` when there was a session to localise in: trajectory.tum anew with `poses`,
  /// which are in the session's map, and localisation.csv with every registration.
  void write_localisation(const std::vector<evaluation::StampedPose>& poses,
                          const std::vector<localisation::LocalisationResult>& registrations) const;

  /// timing.json: `wall_s` and `bag_s` are the seconds that passed and the seconds of data.
  void write_timing(const evaluation::StageTimes& times, double wall_s, double bag_s) const;

  /// warnings.txt: warnings and errors with their counts.
  void write_warnings(const Reporter& reporter) const;

  std::size_t scans() const { return poses_.size(); }
  const std::filesystem::path& path() const { return path_; }

 private:
  void revise(const std::vector<imu::NavState>& states);
  void write_degeneracy(const ScanOutput& output);
  void write_covariance(const odometry::EstimateResult& estimate);
  void write_directions(const odometry::EstimateResult& estimate);
  void write_trajectory(const std::string& name, const std::vector<evaluation::StampedPose>& poses) const;
  void write_fixes(const mapping::GlobalOptimizer& global) const;
  void write_georeference(const mapping::GlobalOptimizer& global,
                          const std::vector<evaluation::StampedPose>& corrected) const;

  std::filesystem::path path_;
  evaluation::TrajectoryWriter trajectory_;
  evaluation::TrajectoryWriter odometry_;
  std::ofstream degeneracy_;
  std::ofstream covariance_;
  std::ofstream directions_;
  std::vector<evaluation::StampedPose> poses_;  ///< T_odom_imu of every scan
};

}  // namespace fdi_lio::pipeline
