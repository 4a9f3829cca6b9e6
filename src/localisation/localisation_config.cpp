#include "fdi_lio/localisation/localisation_config.hpp"

namespace fdi_lio::localisation {

void LocalisationConfig::visit(ParameterVisitor& v) {
  v.text({"localisation.session", "",
          "folder of a saved session to localise in, without changing it; empty: make a map of one's own"},
         session);
  v.real({"localisation.period", "s", "time between two registrations with the session"}, period_s, 0.05,
         60.0);
  v.real({"localisation.distance", "m", "way after which a registration comes sooner"}, distance_m, 0.1,
         100.0);
  v.real({"localisation.search_period", "s", "time between two searches while the place is not known"},
         search_period_s, 0.05, 60.0);
  v.integer({"localisation.search_candidates", "", "places that are registered in one search"},
            search_candidates, 1, 100);
  v.real({"localisation.submap_radius", "m", "keyframes of the session so near make the submap"},
         submap_radius_m, 1.0, 500.0);
  v.real({"localisation.initial_sigma_translation", "m",
          "standard deviation of an initial pose that comes without one"},
         initial_sigma_translation_m, 0.01, 100.0);
  v.real({"localisation.initial_sigma_rotation", "deg",
          "standard deviation of an initial heading that comes without one"},
         initial_sigma_rotation_deg, 0.1, 180.0);
  v.integer({"localisation.confirmations", "",
             "later registrations that must agree by odometry before a place is believed"},
            confirmations, 1, 100);
  v.real({"localisation.confirm_distance", "m", "way over which they must agree, or the time below"},
         confirm_distance_m, 0.0, 1000.0);
  v.real({"localisation.confirm_time", "s", "time over which they must agree, or the way above"},
         confirm_time_s, 0.0, 1000.0);
  v.real({"localisation.ambiguity", "",
          "another place with this share of the best one's fit (walls times brightness) keeps it from being "
          "believed"},
         ambiguity, 0.0, 1.0);
  v.real({"localisation.min_fit", "",
          "where the walls of several places are alike, walls times brightness must fit so well"},
         min_fit, 0.0, 1.0);
  v.integer({"localisation.max_failures", "", "registrations that fail in a row before the place is lost"},
            max_failures, 1, 1000);
}

}  // namespace fdi_lio::localisation
