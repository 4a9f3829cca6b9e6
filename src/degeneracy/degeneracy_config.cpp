#include "fdi_lio/degeneracy/degeneracy_config.hpp"

namespace fdi_lio::degeneracy {

namespace {

void visit_metrics(DegeneracyConfig& c, ParameterVisitor& v) {
  v.integer({"degeneracy.max_samples", "", "points of a scan that the metrics look at (every k-th point)"},
            c.max_samples, 100, 1000000);
  v.real({"degeneracy.voxel", "m", "voxel of the local covariances near the sensor"}, c.voxel_m, 0.1, 10.0);
  v.real({"degeneracy.voxel_growth_range", "m",
          "from this range on, and at each doubling of it, voxels are twice as large"},
         c.voxel_growth_range_m, 1.0, 1000.0);
  v.integer({"degeneracy.voxel_min_points", "", "points that a voxel needs for a covariance"},
            c.voxel_min_points, 4, 1000);
  v.integer({"degeneracy.voxel_min_ring_span", "",
             "rings that a voxel must span beyond the first, unless the scan has one"},
            c.voxel_min_ring_span, 0, 16);
  v.real({"degeneracy.orientation_share", "",
          "share of the entropy of the surfaces' orientations in the geometric complexity"},
         c.orientation_share, 0.0, 1.0);
  v.integer({"degeneracy.entropy_reference_voxels", "",
             "voxels that are evenly filled at least for a point entropy of 1"},
            c.entropy_reference_voxels, 2, 1000000);
  v.integer({"degeneracy.curvature_neighbours", "",
             "least distance of a curvature's two ends along the ring, in points"},
            c.curvature_neighbours, 1, 20);
  v.real({"degeneracy.curvature_half_width", "m", "wanted distance of a curvature's two ends"},
         c.curvature_half_width_m, 0.0, 5.0);
  v.real({"degeneracy.curvature_floor", "", "added to the median curvature that the spread is divided by"},
         c.curvature_floor, 1e-3, 10.0);
  v.real({"degeneracy.gradient_floor", "",
          "intensity gradient that noise makes on a blank surface, in units of ln(1 + I / scale)"},
         c.gradient_floor, 1e-3, 1.0);
  v.real({"degeneracy.gradient_percentile", "",
          "quantile of the intensity gradient that counts as the scan's maximum"},
         c.gradient_percentile, 0.5, 1.0);
}

void visit_sub_factors(DegeneracyConfig& c, ParameterVisitor& v) {
  v.real(
      {"degeneracy.complexity_gain", "", "slope of the structural sub-factor over the geometric complexity"},
      c.complexity_gain, 0.0, 100.0);
  v.real({"degeneracy.complexity_centre", "", "geometric complexity that counts half"}, c.complexity_centre,
         0.0, 1.0);
  v.real({"degeneracy.deviation_gain", "",
          "slope of the structural sub-factor over the relative plane deviation"},
         c.deviation_gain, 0.0, 100.0);
  v.real({"degeneracy.deviation_scale", "m", "plane deviation that counts half"}, c.deviation_scale_m, 1e-3,
         10.0);
  v.real({"degeneracy.entropy_gain", "", "slope of the sparse sub-factor over the point entropy"},
         c.entropy_gain, 0.0, 100.0);
  v.real({"degeneracy.entropy_centre", "", "neutral point entropy"}, c.entropy_centre, 0.0, 1.0);
  v.real({"degeneracy.gradient_gain", "", "slope of the sparse sub-factor over the mean intensity gradient"},
         c.gradient_gain, 0.0, 100.0);
  v.real({"degeneracy.gradient_centre", "", "neutral mean intensity gradient"}, c.gradient_centre, 0.0, 1.0);
  v.real({"degeneracy.curvature_gain", "", "slope of the dynamic sub-factor over the curvature complexity"},
         c.curvature_gain, 0.0, 100.0);
  v.real({"degeneracy.curvature_centre", "", "neutral curvature complexity"}, c.curvature_centre, 0.0, 100.0);
  v.real({"degeneracy.gradient_variation_gain", "",
          "slope of the dynamic sub-factor over the gradient's variation"},
         c.gradient_variation_gain, 0.0, 100.0);
  v.real({"degeneracy.gradient_variation_centre", "", "neutral variation of the intensity gradient"},
         c.gradient_variation_centre, 0.0, 100.0);
  v.real({"degeneracy.moving_gain", "",
          "slope of the dynamic sub-factor over the logarithm of the share of moving points"},
         c.moving_gain, 0.0, 100.0);
  v.real({"degeneracy.moving_centre", "", "neutral share of moving points"}, c.moving_centre, 1e-3, 1.0);
  v.real({"degeneracy.uncertainty_structural_gain", "",
          "slope of the structural sub-factor over the logarithm of the position's uncertainty"},
         c.uncertainty_structural_gain, 0.0, 100.0);
  v.real({"degeneracy.uncertainty_sparse_gain", "",
          "slope of the sparse sub-factor over the logarithm of the position's uncertainty"},
         c.uncertainty_sparse_gain, 0.0, 100.0);
  v.real({"degeneracy.uncertainty_centre", "m",
          "standard deviation of the position in its weakest direction that counts half"},
         c.uncertainty_centre_m, 1e-6, 10.0);
}

void visit_weights(DegeneracyConfig& c, ParameterVisitor& v) {
  v.integer({"degeneracy.window", "scans", "length of the sliding window of the histograms"}, c.window_scans,
            1, 10000);
  v.integer({"degeneracy.histogram_bins", "", "B: bins of a sub-factor's histogram over [0, 1]"},
            c.histogram_bins, 2, 1000);
  v.real({"degeneracy.histogram_smoothing", "scans", "count that each bin starts with"},
         c.histogram_smoothing, 1e-6, 100.0);
  const std::string meaning =
      ": its reference distribution, B numbers that are learned by learn_reference.py; empty: see "
      "degeneracy.reference_scale";
  v.text({"degeneracy.reference_structural", "", "structural sub-factor" + meaning}, c.reference_structural);
  v.text({"degeneracy.reference_sparse", "", "sparse sub-factor" + meaning}, c.reference_sparse);
  v.text({"degeneracy.reference_dynamic", "", "dynamic sub-factor" + meaning}, c.reference_dynamic);
  v.real({"degeneracy.reference_scale", "",
          "decay of a reference distribution that is not learned, proportional to exp(-x / scale)"},
         c.reference_scale, 0.05, 1000.0);
  v.real({"degeneracy.weight_entropy", "", "share of small entropy in the information of a sub-factor"},
         c.weight_entropy, 0.0, 100.0);
  v.real({"degeneracy.weight_divergence", "", "share of the divergence in the information of a sub-factor"},
         c.weight_divergence, 0.0, 100.0);
  v.real({"degeneracy.weight_floor", "", "information that each sub-factor has at least"}, c.weight_floor,
         1e-6, 100.0);
}

}  // namespace

void DegeneracyConfig::visit(ParameterVisitor& v) {
  visit_metrics(*this, v);
  visit_sub_factors(*this, v);
  visit_weights(*this, v);
  v.integer({"degeneracy.class_hold", "scans",
             "consecutive scans that another class must win before the class changes"},
            class_hold_scans, 1, 1000);
  v.real({"degeneracy.class_margin", "",
          "by how much another class's score must exceed that of the present class"},
         class_margin, 0.0, 1.0);
  v.real({"degeneracy.class_poor_threshold", "",
          "larger of the structural and the sparse sub-factor from which surroundings are sparse or mixed"},
         class_poor_threshold, 0.01, 0.99);
  v.real({"degeneracy.class_dynamic_threshold", "",
          "dynamic sub-factor from which surroundings are dynamic or mixed"},
         class_dynamic_threshold, 0.01, 0.99);
}

}  // namespace fdi_lio::degeneracy
