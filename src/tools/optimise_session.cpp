#include <cmath>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/localisation/localiser.hpp"
#include "fdi_lio/mapping/loop_file.hpp"
#include "fdi_lio/mapping/session_io.hpp"

namespace {

using fdi_lio::Error;
namespace localisation = fdi_lio::localisation;
namespace mapping = fdi_lio::mapping;

const char* const kUsage =
    "usage: optimise_session --config FILE --session DIR [--merge DIR] --output DIR [--set key=value]... "
    "[--drift SHARE] [--seed N]\n"
    "Looks for the loops of a saved session anew, with other parameters, and saves the result as a new "
    "session\n"
    "with loops.csv. --merge puts a second session into the map of the first: where it lies there is found "
    "as in "
    "localisation,\n"
    "and loops between the two make it sure. --drift adds an error to the odometry first that grows to about "
    "SHARE of the way (0.02: "
    "2 %),\n"
    "half of it steady and half random, to see what the loops can mend.\n"
    "Exit code: 0 done, 2 not possible as asked.\n";

struct Options {
  std::string config;
  std::string session;
  std::string merged;  ///< a second session; empty: none
  std::string output;
  std::vector<std::string> overrides;
  double drift_share = 0.0;
  unsigned seed = 1;
};

Options parse(const std::vector<std::string>& arguments) {
  Options options;
  for (std::size_t i = 0; i + 1 < arguments.size(); i += 2) {
    const std::string& name = arguments[i];
    const std::string& value = arguments[i + 1];
    if (name == "--config") {
      options.config = value;
    } else if (name == "--session") {
      options.session = value;
    } else if (name == "--merge") {
      options.merged = value;
    } else if (name == "--output") {
      options.output = value;
    } else if (name == "--set") {
      options.overrides.push_back(value);
    } else if (name == "--drift") {
      options.drift_share = std::stod(value);
    } else if (name == "--seed") {
      options.seed = static_cast<unsigned>(std::stoul(value));
    } else {
      throw Error("unknown argument '" + name + "'\n" + kUsage);
    }
  }
  if (arguments.size() % 2 != 0 || options.session.empty() || options.output.empty())
    throw Error(std::string("--session and --output are needed\n") + kUsage);
  return options;
}

/// An error of heading, half of it steady, and of length in every step of the odometry. A steady error of
/// length is left out: a place that is a little too small closes as well.
class Drift {
 public:
  Drift(double share, unsigned seed) : share_(share), random_(seed) {}

  Eigen::Isometry3d spoil(Eigen::Isometry3d step) {
    const double way_m = step.translation().norm();
    std::normal_distribution<double> normal;
    step.translation() *= 1.0 + share_ * normal(random_);
    // A steady turn of k rad/m leads about k L / 2 of the way L astray: chosen for L = 500 m.
    constexpr double kReferenceWayM = 500.0;
    const double turn = share_ * way_m / kReferenceWayM;
    const double random_turn = share_ * std::sqrt(way_m / kReferenceWayM) * normal(random_);
    step.rotate(fdi_lio::so3::exp_q(Eigen::Vector3d(0.0, 0.0, turn + 0.5 * random_turn)));
    return step;
  }

 private:
  double share_;
  std::mt19937 random_;
};

/// Adds all keyframes of a session, of which the odometry begins at `T_odom_begin`.
void add_session(const mapping::Session& session, const Eigen::Isometry3d& T_odom_begin, Drift* drift,
                 mapping::GlobalOptimizer* global) {
  Eigen::Isometry3d T_odom_imu = T_odom_begin;
  for (std::size_t k = 0; k < session.keyframes.size(); ++k) {
    mapping::Keyframe keyframe;
    keyframe.stamp = session.keyframes[k].stamp;
    keyframe.begins_session = k == 0 && global->size() > 0;
    if (k > 0) {
      const mapping::RelativePose& edge = session.graph.odometry[k - 1];
      T_odom_imu = T_odom_imu * drift->spoil(edge.T_from_to);
      // The edge's covariance has the random walk too, which the optimiser adds again: small beside it.
      fdi_lio::Matrix6d to_odom = fdi_lio::Matrix6d::Identity();
      to_odom.bottomRightCorner<3, 3>() = T_odom_imu.linear();
      keyframe.covariance = to_odom * edge.information.inverse() * to_odom.transpose();
    }
    keyframe.T_odom_imu = T_odom_imu;
    keyframe.cloud = mapping::load_session_cloud(session, k);
    global->add(std::move(keyframe));
  }
}

/// Where the odometry of `session` begins in the map of `base`. Throws Error when its place is not found
/// there.
Eigen::Isometry3d find_begin(const fdi_lio::Config& config, const mapping::Session& base,
                             const mapping::Session& session, fdi_lio::Reporter* reporter) {
  localisation::Localiser localiser(config, base, reporter);
  for (std::size_t k = 0; k < session.keyframes.size(); ++k) {
    mapping::Keyframe keyframe;
    keyframe.stamp = session.keyframes[k].stamp;
    keyframe.T_odom_imu = session.keyframes[k].T_odom_imu;
    keyframe.cloud = mapping::load_session_cloud(session, k);
    localiser.add(keyframe);
    if (localiser.T_map_odom()) return *localiser.T_map_odom() * session.keyframes.front().T_odom_imu;
  }
  throw Error("the place of " + session.path + " was not found in " + base.path + ": nothing was merged");
}

int run(const Options& options) {
  const fdi_lio::Config config = fdi_lio::load_config(options.config, options.overrides);
  const mapping::Session session = mapping::load_session(options.session);
  fdi_lio::Reporter reporter;
  mapping::GlobalOptimizer global(config, &reporter);
  Drift drift(options.drift_share, options.seed);
  add_session(session, session.keyframes.front().T_odom_imu, &drift, &global);
  if (!options.merged.empty()) {
    const mapping::Session merged = mapping::load_session(options.merged);
    const Eigen::Isometry3d T_map_begin = find_begin(config, session, merged, &reporter);
    // The newest correction of the map brings it to the odometry that the optimiser goes on with.
    add_session(merged, global.T_map_odom().inverse() * T_map_begin, &drift, &global);
  }
  mapping::SessionOptions session_options;
  session_options.map_voxel_m = config.mapping.output_map_voxel_m;
  mapping::save_session(global, session_options, options.output);
  mapping::write_loops(options.output + "/loops.csv", global.loops());
  std::cout << global.size() << " keyframes, " << global.graph().loops.size() << " of "
            << global.loops().size() << " loop candidates accepted\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parse(std::vector<std::string>(argv + 1, argv + argc)));
  } catch (const std::exception& error) {
    std::cerr << "optimise_session: " << error.what() << "\n";
    return 2;
  }
}
