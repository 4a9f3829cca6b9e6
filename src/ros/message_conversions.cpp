#include "fdi_lio/ros/message_conversions.hpp"

#include <boost/make_shared.hpp>

namespace fdi_lio::ros_bridge {

namespace {

geometry_msgs::Vector3 to_message(const Eigen::Vector3d& v) {
  geometry_msgs::Vector3 message;
  message.x = v.x();
  message.y = v.y();
  message.z = v.z();
  return message;
}

Eigen::Vector3d to_vector(const geometry_msgs::Vector3& message) { return {message.x, message.y, message.z}; }

geometry_msgs::Quaternion to_message(const Eigen::Quaterniond& q) {
  geometry_msgs::Quaternion message;
  message.x = q.x();
  message.y = q.y();
  message.z = q.z();
  message.w = q.w();
  return message;
}

Eigen::Quaterniond to_quaternion(const geometry_msgs::Quaternion& message) {
  return {message.w, message.x, message.y, message.z};
}

/// A fixed-size matrix to an array of the same size, row by row.
template <typename Matrix, typename Array>
void fill(const Matrix& matrix, Array* array) {
  static_assert(int{Matrix::SizeAtCompileTime} == int{Array::static_size}, "matrix and array differ in size");
  for (int row = 0; row < matrix.rows(); ++row) {
    for (int column = 0; column < matrix.cols(); ++column)
      (*array)[static_cast<std::size_t>(row * matrix.cols() + column)] = matrix(row, column);
  }
}

template <typename Array, typename Matrix>
void read(const Array& array, Matrix* matrix) {
  static_assert(int{Matrix::SizeAtCompileTime} == int{Array::static_size}, "matrix and array differ in size");
  for (int row = 0; row < matrix->rows(); ++row) {
    for (int column = 0; column < matrix->cols(); ++column)
      (*matrix)(row, column) = array[static_cast<std::size_t>(row * matrix->cols() + column)];
  }
}

}  // namespace

ros::Time to_ros_time(Stamp stamp) {
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(stamp));
  return time;
}

Stamp to_stamp(const ros::Time& time) { return static_cast<Stamp>(time.toNSec()); }

DegeneracyPtr to_message(const degeneracy::Degeneracy& degeneracy, const std::string& imu_frame) {
  auto message = boost::make_shared<Degeneracy>();
  message->header.stamp = to_ros_time(degeneracy.stamp);
  message->header.frame_id = imu_frame;
  message->fdi = degeneracy.fdi;
  for (std::size_t k = 0; k < 3; ++k) {
    message->sub_factors[k] = degeneracy.sub_factors[k];
    message->weights[k] = degeneracy.weights[k];
  }
  message->geometric_complexity = degeneracy.metrics.geometric_complexity;
  message->curvature_complexity = degeneracy.metrics.curvature_complexity;
  message->point_entropy = degeneracy.metrics.point_entropy;
  message->plane_deviation = degeneracy.metrics.plane_deviation_m;
  message->has_gradient = degeneracy.metrics.has_gradient;
  message->gradient_mean = degeneracy.metrics.gradient_mean;
  message->gradient_variation = degeneracy.metrics.gradient_variation;
  message->points = degeneracy.metrics.points;
  message->has_moving_share = degeneracy.metrics.has_moving_share;
  message->moving_share = degeneracy.metrics.moving_share;
  message->position_sigma = degeneracy.metrics.position_sigma_m;
  message->environment = static_cast<std::uint8_t>(degeneracy.environment);
  fill(degeneracy.axes, &message->axes);
  fill(degeneracy.localizability, &message->localizability);
  return message;
}

degeneracy::Degeneracy to_degeneracy(const Degeneracy& message) {
  degeneracy::Degeneracy degeneracy;
  degeneracy.stamp = to_stamp(message.header.stamp);
  degeneracy.fdi = message.fdi;
  for (std::size_t k = 0; k < 3; ++k) {
    degeneracy.sub_factors[k] = message.sub_factors[k];
    degeneracy.weights[k] = message.weights[k];
  }
  degeneracy.metrics.geometric_complexity = message.geometric_complexity;
  degeneracy.metrics.curvature_complexity = message.curvature_complexity;
  degeneracy.metrics.point_entropy = message.point_entropy;
  degeneracy.metrics.plane_deviation_m = message.plane_deviation;
  degeneracy.metrics.has_gradient = message.has_gradient != 0;
  degeneracy.metrics.gradient_mean = message.gradient_mean;
  degeneracy.metrics.gradient_variation = message.gradient_variation;
  degeneracy.metrics.points = message.points;
  degeneracy.metrics.has_moving_share = message.has_moving_share != 0;
  degeneracy.metrics.moving_share = message.moving_share;
  degeneracy.metrics.position_sigma_m = message.position_sigma;
  degeneracy.environment = static_cast<degeneracy::EnvironmentClass>(message.environment & 3U);
  read(message.axes, &degeneracy.axes);
  read(message.localizability, &degeneracy.localizability);
  return degeneracy;
}

OptimisationStatusPtr to_status_message(const odometry::EstimateResult& estimate,
                                        const std::string& imu_frame) {
  auto message = boost::make_shared<OptimisationStatus>();
  message->header.stamp = to_ros_time(estimate.status.stamp);
  message->header.frame_id = imu_frame;
  fill(estimate.status.axes, &message->axes);
  fill(estimate.status.localizability, &message->localizability);
  message->position_sigma = degeneracy::weakest_position_sigma_m(estimate.map_covariance);
  message->residual_rms = estimate.status.residual_rms_m;
  message->iterations = estimate.status.iterations;
  message->matched = estimate.status.matched;
  message->healthy = estimate.is_healthy;
  message->keyframe = estimate.is_keyframe;
  return message;
}

degeneracy::OptimisationStatus to_status(const OptimisationStatus& message) {
  degeneracy::OptimisationStatus status;
  status.stamp = to_stamp(message.header.stamp);
  read(message.axes, &status.axes);
  read(message.localizability, &status.localizability);
  status.position_sigma_m = message.position_sigma;
  status.residual_rms_m = message.residual_rms;
  status.iterations = message.iterations;
  status.matched = message.matched;
  return status;
}

EstimatorStatePtr to_state_message(const odometry::EstimateResult& estimate, Stamp answers,
                                   const std::string& odom_frame, const std::string& imu_frame) {
  const imu::NavState& state = estimate.state;
  auto message = boost::make_shared<EstimatorState>();
  message->header.stamp = to_ros_time(state.stamp);
  message->header.frame_id = odom_frame;
  message->child_frame_id = imu_frame;
  message->answers = to_ros_time(answers);
  message->orientation = to_message(state.q_odom_imu);
  message->position = to_message(state.t_odom_imu);
  message->velocity = to_message(state.v_odom);
  message->gyro_bias = to_message(state.gyro_bias);
  message->accel_bias = to_message(state.accel_bias);
  fill(state.gyro_scale, &message->gyro_scale);
  message->mounting = to_message(state.mounting);
  message->lidar_time_offset = state.lidar_time_offset_s;
  message->gravity = to_message(state.g_odom);
  message->angular_velocity = to_message(state.w_imu);
  message->imu_status = static_cast<std::uint8_t>(state.imu_status);
  fill(estimate.covariance, &message->covariance);
  fill(estimate.velocity_covariance, &message->velocity_covariance);
  return message;
}

imu::NavState to_state(const EstimatorState& message) {
  imu::NavState state;
  state.stamp = to_stamp(message.header.stamp);
  state.q_odom_imu = to_quaternion(message.orientation);
  state.t_odom_imu = to_vector(message.position);
  state.v_odom = to_vector(message.velocity);
  state.gyro_bias = to_vector(message.gyro_bias);
  state.accel_bias = to_vector(message.accel_bias);
  read(message.gyro_scale, &state.gyro_scale);
  state.mounting = to_vector(message.mounting);
  state.lidar_time_offset_s = message.lidar_time_offset;
  state.g_odom = to_vector(message.gravity);
  state.w_imu = to_vector(message.angular_velocity);
  state.imu_status = static_cast<imu::ImuStatus>(message.imu_status);
  return state;
}

PreintegratedImuPtr to_message(const imu::Preintegration& preintegration, const std::string& imu_frame) {
  auto message = boost::make_shared<PreintegratedImu>();
  message->header.stamp = to_ros_time(preintegration.to);
  message->header.frame_id = imu_frame;
  message->begin = to_ros_time(preintegration.from);
  message->available = true;
  message->delta_q = to_message(preintegration.delta_q);
  message->delta_v = to_message(preintegration.delta_v);
  message->delta_p = to_message(preintegration.delta_p);
  fill(preintegration.covariance, &message->covariance);
  message->gyro_bias = to_message(preintegration.gyro_bias);
  message->accel_bias = to_message(preintegration.accel_bias);
  fill(preintegration.gyro_scale, &message->gyro_scale);
  message->lidar_time_offset = preintegration.lidar_time_offset_s;
  fill(preintegration.dq_dbg, &message->dq_dbg);
  fill(preintegration.dv_dbg, &message->dv_dbg);
  fill(preintegration.dv_dba, &message->dv_dba);
  fill(preintegration.dp_dbg, &message->dp_dbg);
  fill(preintegration.dp_dba, &message->dp_dba);
  message->dq_doffset = to_message(preintegration.dq_doffset);
  message->sample_count = preintegration.sample_count;
  message->longest_gap = preintegration.longest_gap_s;
  message->last_angular_velocity = to_message(preintegration.last_angular_velocity);
  const imu::ImuStatistics& recent = preintegration.recent;
  message->recent_duration = recent.duration_s;
  message->recent_count = recent.count;
  message->recent_acceleration = to_message(recent.mean_acceleration);
  message->recent_angular_velocity = to_message(recent.mean_angular_velocity);
  message->recent_acceleration_std = recent.acceleration_std;
  message->recent_angular_velocity_std = recent.angular_velocity_std;
  message->recent_acceleration_noise = recent.acceleration_noise;
  message->recent_angular_velocity_noise = recent.angular_velocity_noise;
  return message;
}

imu::Preintegration to_preintegration(const PreintegratedImu& message) {
  imu::Preintegration preintegration;
  preintegration.from = to_stamp(message.begin);
  preintegration.to = to_stamp(message.header.stamp);
  preintegration.delta_q = to_quaternion(message.delta_q);
  preintegration.delta_v = to_vector(message.delta_v);
  preintegration.delta_p = to_vector(message.delta_p);
  read(message.covariance, &preintegration.covariance);
  preintegration.gyro_bias = to_vector(message.gyro_bias);
  preintegration.accel_bias = to_vector(message.accel_bias);
  read(message.gyro_scale, &preintegration.gyro_scale);
  preintegration.lidar_time_offset_s = message.lidar_time_offset;
  read(message.dq_dbg, &preintegration.dq_dbg);
  read(message.dv_dbg, &preintegration.dv_dbg);
  read(message.dv_dba, &preintegration.dv_dba);
  read(message.dp_dbg, &preintegration.dp_dbg);
  read(message.dp_dba, &preintegration.dp_dba);
  preintegration.dq_doffset = to_vector(message.dq_doffset);
  preintegration.sample_count = message.sample_count;
  preintegration.longest_gap_s = message.longest_gap;
  preintegration.last_angular_velocity = to_vector(message.last_angular_velocity);
  preintegration.recent.duration_s = message.recent_duration;
  preintegration.recent.count = message.recent_count;
  preintegration.recent.mean_acceleration = to_vector(message.recent_acceleration);
  preintegration.recent.mean_angular_velocity = to_vector(message.recent_angular_velocity);
  preintegration.recent.acceleration_std = message.recent_acceleration_std;
  preintegration.recent.angular_velocity_std = message.recent_angular_velocity_std;
  preintegration.recent.acceleration_noise = message.recent_acceleration_noise;
  preintegration.recent.angular_velocity_noise = message.recent_angular_velocity_noise;
  return preintegration;
}

}  // namespace fdi_lio::ros_bridge
