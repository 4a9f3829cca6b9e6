#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

void IntensityConfig::visit(ParameterVisitor& v) {
  v.flag({"intensity.enabled", "", "use intensity at all; off: geometry only"}, enabled);
  v.real({"intensity.range_exponent", "",
          "a: intensities are multiplied by (range / reference_range)^a; 0 for calibrated reflectivity"},
         range_exponent, 0.0, 4.0);
  v.real({"intensity.incidence_exponent", "",
          "b: intensities are divided by the cosine of the incidence angle to the power b"},
         incidence_exponent, 0.0, 2.0);
  v.real({"intensity.reference_range", "m", "range at which intensities stay as they are"}, reference_range_m,
         0.1, 100.0);
  v.flag({"intensity.range_profile", "", "learn how intensity depends on range"}, range_profile);
  v.flag({"intensity.beam_gains", "", "learn how the gains of the beams differ"}, beam_gains);
  v.real({"intensity.rescale_factor", "",
          "when the median differs from the scale by more than this factor, the sensor's scale has changed"},
         rescale_factor, 2.0, 1000.0);
  v.integer({"intensity.rescale_scans", "", "for so many scans, before the scale is found anew"},
            rescale_scans, 1, 1000);
}

void GradientConfig::visit(ParameterVisitor& v) {
  v.choice({"gradient.neighbourhood", "",
            "knn: nearest neighbours; radius: all within a radius; adaptive: radius where the points are "
            "dense, else the nearest"},
           neighbourhood, {"adaptive", "knn", "radius"});
  v.integer({"gradient.fine_neighbours", "", "k of the fine scale"}, fine_neighbours, 2, 12);
  v.integer({"gradient.coarse_neighbours", "", "k of the coarse scale"}, coarse_neighbours, 4, 40);
  v.real({"gradient.fine_radius", "m", "radius of the fine scale"}, fine_radius_m, 0.02, 5.0);
  v.real({"gradient.coarse_radius", "m", "radius of the coarse scale"}, coarse_radius_m, 0.05, 20.0);
  v.real({"gradient.sample_spacing", "m",
          "near the sensor, where points are denser, neighbours along a ring are taken this far apart"},
         sample_spacing_m, 0.0, 2.0);
  v.flag({"gradient.smoothing", "", "Kalman filter over the scans"}, smoothing);
  v.real({"gradient.process_noise", "", "variance that the gradient of a place gains from scan to scan"},
         process_noise, 0.0, 10.0);
  v.real({"gradient.measurement_noise", "", "variance of one measured gradient"}, measurement_noise, 1e-6,
         10.0);
}

void IsolationConfig::visit(ParameterVisitor& v) {
  v.integer({"isolation.min_neighbours", "",
             "points with fewer neighbours hang in the air (dust, rain, snow) and are removed; 0: none are"},
            min_neighbours, 0, 10);
  v.real({"isolation.reach", "m", "neighbours are nearer than this"}, reach_m, 0.0, 10.0);
  v.real({"isolation.reach_columns", "", "and farther by so many spacings of the points along a ring"},
         reach_columns, 0.0, 100.0);
}

void DynamicConfig::visit(ParameterVisitor& v) {
  v.choice({"dynamic.mode", "",
            "how moving points are found. plain: high intensity gradient at a range jump; full: what earlier "
            "scans saw through"},
           mode, {"off", "plain", "full"});
  v.real({"dynamic.gradient_deviations", "", "kappa of the plain criterion"}, gradient_deviations, 0.0, 20.0);
  v.real({"dynamic.range_jump", "", "eps_r of the plain criterion, as a share of the range"}, range_jump,
         1e-3, 1.0);
  v.real({"dynamic.safety_factor", "", "lambda of the plain criterion"}, safety_factor, 0.1, 10.0);
  v.integer({"dynamic.past_scans", "", "earlier scans that each point is looked up in"}, past_scans, 1, 10);
  v.real({"dynamic.past_spacing", "s", "time between these scans"}, past_spacing_s, 0.05, 5.0);
  v.real({"dynamic.free_margin", "m", "an earlier scan saw through a place if it saw farther by this"},
         free_margin_m, 0.01, 5.0);
  v.real({"dynamic.free_margin_share", "", "and by this share of the range"}, free_margin_share, 0.0, 0.5);
  v.real({"dynamic.touch_distance", "m", "points nearer than this can belong to one object"},
         touch_distance_m, 0.01, 5.0);
  v.real({"dynamic.touch_share", "", "and farther by this share of the range"}, touch_share, 0.0, 0.5);
  v.integer({"dynamic.min_object_points", "", "smaller moving objects are taken for noise"},
            min_object_points, 1, 1000);
  v.real({"dynamic.max_static_share", "",
          "objects with more static points among those that they touch are taken for leaves and wires"},
         max_static_share, 0.0, 1.0);
}

}  // namespace fdi_lio::scan
