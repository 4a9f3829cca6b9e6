#pragma once

#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::matching {

/// What one scan says of the mean radius, whatever its pose: cost(d) = information d^2 / 2 + gradient d for a
/// radius larger by d.
struct RadiusEvidence {
  double information = 0.0;  ///< [1/m^2]
  double gradient = 0.0;     ///< [1/m]
};

/// The mean radius of the poles, trunks and edges around, learned while driving past them. A scan sees their
/// near side, so that a line of the map seen from another side lies off by the radius times n . (v - d)
/// (LidarInformation::radius). That has one sign for all of them: what comes ahead and lies behind a second
/// later pulls every scan back. In each scan the radius is one more unknown beside the pose, with what
/// earlier scans say of it as prior, which is forgotten with a time constant of 100 scans.
class MeanRadius {
 public:
  /// `sigma_m`: deviation of the mean about zero before anything is seen [m]; 0: it is zero, and stays so.
  explicit MeanRadius(double sigma_m);

  /// To be given to the matcher as MatchSettings::line_radius_m.
  double mean_m() const { return mean_m_; }

  /// Takes the unknown radius out of normal equations that were made with mean_m() (Schur complement, H and b
  /// of the pose), and says what they know of it for every pose alike.
  RadiusEvidence eliminate(LidarInformation* information) const;

  /// Learns from a scan, once.
  void learn(const RadiusEvidence& evidence);

 private:
  double least_information_;  ///< that of `sigma_m`, which is never forgotten; 0: nothing is learned
  double information_;
  double mean_m_ = 0.0;
};

}  // namespace fdi_lio::matching
