#include "fdi_lio/pipeline/run_directory.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <system_error>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/mapping/loop_file.hpp"
#include "fdi_lio/mapping/map_file.hpp"
#include "fdi_lio/version.hpp"

namespace fdi_lio::pipeline {

namespace {

std::filesystem::path make_folder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!std::filesystem::is_directory(path, error)) {
    throw Error("cannot make the output folder " + path + ": " + error.message());
  }
  return path;
}

std::ofstream open_for_writing(const std::filesystem::path& path) {
  std::ofstream out(path);
  if (!out) throw Error("cannot write " + path.string() + ": check that the folder may be written");
  return out;
}

void check_written(const std::ofstream& out, const std::filesystem::path& path) {
  if (!out) throw Error("cannot write " + path.string() + ": is the disk full?");
}

}  // namespace

RunDirectory::RunDirectory(const std::string& path, const Config& config)
    : path_(make_folder(path)),
      trajectory_((path_ / "trajectory.tum").string()),
      odometry_((path_ / "odometry.tum").string()),
      degeneracy_(open_for_writing(path_ / "degeneracy.csv")),
      covariance_(open_for_writing(path_ / "covariance.csv")),
      directions_(open_for_writing(path_ / "directions.csv")) {
  // Of an earlier run, and without fixes nothing would take their place.
  std::error_code ignored;
  for (const char* name : {"fixes.csv", "trajectory_enu.tum", "georeference.yaml"})
    std::filesystem::remove(path_ / name, ignored);
  std::ofstream run = open_for_writing(path_ / "run.yaml");
  run << "# fdi_lio " << kVersion << ", every parameter as used\n";
  write_config(config, run);
  run.flush();
  check_written(run, path_ / "run.yaml");
  degeneracy_ << "stamp,fdi,structural,sparse,dynamic,weight_structural,weight_sparse,weight_dynamic,class,"
                 "geometric_complexity,curvature_complexity,point_entropy,plane_deviation,gradient_mean,"
                 "gradient_variation,moving_share,position_sigma,points,planes,edges,textures,matched,"
                 "matched_textures,iterations,residual_rms";
  for (int axis = 0; axis < 6; ++axis) degeneracy_ << ",localizability_" << axis;
  degeneracy_ << '\n';
  degeneracy_.precision(std::numeric_limits<double>::max_digits10);
  covariance_ << "stamp";
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) covariance_ << ",c" << row << column;
  }
  covariance_ << '\n';
  directions_ << "stamp,axis,probability,information,noise,rx,ry,rz,tx,ty,tz\n";
}

void RunDirectory::add(const ScanOutput& output) {
  if (!output.estimate.revised.empty()) revise(output.estimate.revised);
  const imu::NavState& state = output.estimate.state;
  trajectory_.add(state.stamp, state.q_odom_imu, state.t_odom_imu);
  odometry_.add(state.stamp, state.q_odom_imu, state.t_odom_imu);
  write_degeneracy(output);
  write_covariance(output.estimate);
  write_directions(output.estimate);
  poses_.push_back({state.stamp, state.T_odom_imu()});
}

void RunDirectory::revise(const std::vector<imu::NavState>& states) {
  for (const imu::NavState& state : states) {
    const auto pose = std::find_if(poses_.begin(), poses_.end(), [&](const evaluation::StampedPose& known) {
      return known.stamp == state.stamp;
    });
    if (pose != poses_.end()) pose->T = state.T_odom_imu();
  }
  trajectory_ = evaluation::TrajectoryWriter((path_ / "trajectory.tum").string());
  odometry_ = evaluation::TrajectoryWriter((path_ / "odometry.tum").string());
  for (const evaluation::StampedPose& pose : poses_) {
    const Eigen::Quaterniond q(pose.T.rotation());
    trajectory_.add(pose.stamp, q, pose.T.translation());
    odometry_.add(pose.stamp, q, pose.T.translation());
  }
}

void RunDirectory::write_degeneracy(const ScanOutput& output) {
  static constexpr const char* kClasses[] = {"structured", "sparse", "dynamic", "mixed"};
  const degeneracy::Degeneracy& d = output.degeneracy;
  const degeneracy::Metrics& m = d.metrics;
  degeneracy_ << stamp_text(output.estimate.state.stamp) << ',' << d.fdi << ',' << d.sub_factors[0] << ','
              << d.sub_factors[1] << ',' << d.sub_factors[2] << ',' << d.weights[0] << ',' << d.weights[1]
              << ',' << d.weights[2] << ',' << kClasses[static_cast<int>(d.environment)] << ','
              << m.geometric_complexity << ',' << m.curvature_complexity << ',' << m.point_entropy << ','
              << m.plane_deviation_m << ',' << m.gradient_mean << ',' << m.gradient_variation << ','
              << m.moving_share << ',' << m.position_sigma_m << ',' << m.points << ','
              << output.features.planes.size() << ',' << output.features.edges.size() << ','
              << output.features.intensity_edges.size() << ',' << output.estimate.status.matched << ','
              << output.estimate.matched_textures << ',' << output.estimate.status.iterations << ','
              << output.estimate.status.residual_rms_m;
  for (int axis = 0; axis < 6; ++axis) degeneracy_ << ',' << d.localizability[axis];
  degeneracy_ << '\n';
  check_written(degeneracy_, path_ / "degeneracy.csv");
}

void RunDirectory::write_covariance(const odometry::EstimateResult& estimate) {
  covariance_ << stamp_text(estimate.state.stamp);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) covariance_ << ',' << estimate.covariance(row, column);
  }
  covariance_ << '\n';
  check_written(covariance_, path_ / "covariance.csv");
}

void RunDirectory::write_directions(const odometry::EstimateResult& estimate) {
  const degeneracy::OptimisationStatus& status = estimate.status;
  for (int axis = 0; axis < 6; ++axis) {
    directions_ << stamp_text(estimate.state.stamp) << ',' << axis << ',' << status.localizability[axis]
                << ',' << estimate.axis_information[axis] << ',' << estimate.axis_noise[axis];
    for (int row = 0; row < 6; ++row) directions_ << ',' << status.axes(row, axis);
    directions_ << '\n';
  }
  check_written(directions_, path_ / "directions.csv");
}

void RunDirectory::write_global(const mapping::GlobalOptimizer& global, double map_voxel_m) const {
  std::vector<evaluation::StampedPose> corrected;
  for (const evaluation::StampedPose& pose : poses_)
    corrected.push_back({pose.stamp, global.correct(pose.stamp, pose.T)});
  write_trajectory("trajectory.tum", corrected);
  mapping::write_loops((path_ / "loops.csv").string(), global.loops());
  write_fixes(global);
  write_georeference(global, corrected);
  mapping::write_map(mapping::map_source(global), &mapping::KeyframeCloud::surface,
                     mapping::map_file_settings(global, map_voxel_m, mapping::CloudFormat::kPcd),
                     (path_ / "map.pcd").string());
}

void RunDirectory::write_trajectory(const std::string& name,
                                    const std::vector<evaluation::StampedPose>& poses) const {
  const std::filesystem::path path = path_ / name;
  const std::filesystem::path temporary = path.string() + ".part";
  evaluation::write_trajectory(temporary.string(), poses, evaluation::TrajectoryFormat::kTum);
  std::filesystem::rename(temporary, path);
}

void RunDirectory::write_localisation(
    const std::vector<evaluation::StampedPose>& poses,
    const std::vector<localisation::LocalisationResult>& registrations) const {
  write_trajectory("trajectory.tum", poses);
  const std::filesystem::path path = path_ / "localisation.csv";
  std::ofstream out = open_for_writing(path);
  out.precision(std::numeric_limits<double>::max_digits10);
  out << "stamp,state,verdict,overlap,wall_share,residual,intensity_correlation,surface_correlation,chi_"
         "square,weak_directions,"
         "failures,sigma_rotation,sigma_translation\n";
  for (const localisation::LocalisationResult& each : registrations) {
    const mapping::LoopCandidate& registration = each.registration;
    out << stamp_text(each.stamp) << ',' << to_text(each.state) << ',' << to_text(registration.verdict) << ','
        << registration.overlap << ',' << registration.wall_share << ',' << registration.residual_m << ','
        << registration.intensity_correlation << ',' << registration.surface_correlation << ','
        << registration.chi_square << ',' << registration.weak_directions << ',' << each.failures << ','
        << std::sqrt(each.covariance.topLeftCorner<3, 3>().trace()) << ','
        << std::sqrt(each.covariance.bottomRightCorner<3, 3>().trace()) << '\n';
  }
  out.flush();
  check_written(out, path);
}

void RunDirectory::write_fixes(const mapping::GlobalOptimizer& global) const {
  if (global.fixes().empty()) return;
  const std::filesystem::path path = path_ / "fixes.csv";
  std::ofstream out = open_for_writing(path);
  out << "stamp,verdict\n";
  for (const mapping::FixResult& fix : global.fixes())
    out << stamp_text(fix.stamp) << ',' << to_text(fix.verdict) << '\n';
  out.flush();
  check_written(out, path);
}

void RunDirectory::write_georeference(const mapping::GlobalOptimizer& global,
                                      const std::vector<evaluation::StampedPose>& corrected) const {
  const auto alignment = global.alignment();
  const auto origin = global.enu_origin();
  if (!alignment || !origin) return;
  std::vector<evaluation::StampedPose> in_enu;
  for (const evaluation::StampedPose& pose : corrected)
    in_enu.push_back({pose.stamp, alignment->T_enu_map() * pose.T});
  write_trajectory("trajectory_enu.tum", in_enu);
  const std::filesystem::path path = path_ / "georeference.yaml";
  std::ofstream out = open_for_writing(path);
  out.precision(std::numeric_limits<double>::max_digits10);
  const Eigen::Vector3d& t = alignment->t_enu_map;
  out << "# p_enu = Rz(yaw) p_map + translation; x east, y north, z up at the origin (WGS 84)\n"
      << "origin: {latitude: " << origin->latitude_deg << ", longitude: " << origin->longitude_deg
      << ", altitude: " << origin->altitude_m << "}  # deg, deg, m\n"
      << "T_enu_map: {yaw: " << alignment->yaw_rad << ", translation: [" << t.x() << ", " << t.y() << ", "
      << t.z() << "]}  # rad, m\n";
  out.flush();
  check_written(out, path);
}

void RunDirectory::write_timing(const evaluation::StageTimes& times, double wall_s, double bag_s) const {
  std::ofstream out = open_for_writing(path_ / "timing.json");
  times.write_json(out, wall_s, bag_s);
  out.flush();
  check_written(out, path_ / "timing.json");
}

void RunDirectory::write_warnings(const Reporter& reporter) const {
  std::ofstream out = open_for_writing(path_ / "warnings.txt");
  for (const auto& entry : reporter.notices()) {
    if (entry.second.severity == Severity::kInfo) continue;
    out << entry.second.count << " x " << entry.second.text << "\n";
  }
  out.flush();
  check_written(out, path_ / "warnings.txt");
}

}  // namespace fdi_lio::pipeline
