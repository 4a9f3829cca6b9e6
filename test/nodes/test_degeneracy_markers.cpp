#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fdi_lio/ros/degeneracy_markers.hpp"

namespace fdi_lio::ros_bridge {
namespace {

using visualization_msgs::Marker;

degeneracy::Degeneracy tunnel_along_y() {
  degeneracy::Degeneracy d;
  d.stamp = 1700000000123456789;
  d.fdi = 0.62;
  d.sub_factors = {0.9, 0.4, 0.05};
  d.weights = {0.5, 0.3, 0.2};
  d.environment = degeneracy::EnvironmentClass::kSparse;
  d.axes.col(4).setZero();
  d.axes(4, 4) = 1.0;  // translation along y
  d.localizability[4] = 0.1;
  return d;
}

Eigen::Vector3d at(const geometry_msgs::Point& p) { return {p.x, p.y, p.z}; }

TEST(DegeneracyMarkers, TextNamesIndexClassSubFactorsAndWeakDirections) {
  const auto array = degeneracy_markers(tunnel_along_y(), "imu_link");
  ASSERT_EQ(array.markers.size(), 7U);
  const Marker& text = array.markers[0];
  EXPECT_EQ(text.type, Marker::TEXT_VIEW_FACING);
  EXPECT_EQ(text.header.frame_id, "imu_link");
  EXPECT_EQ(text.header.stamp, ros::Time(1700000000, 123456789));
  for (const char* words :
       {"FDI 0.62  sparse", "structural 0.90  (weight 0.50)", "sparse 0.40  (weight 0.30)",
        "dynamic 0.05  (weight 0.20)", "weak along (0.00 1.00 0.00)  p 0.10"}) {
    EXPECT_THAT(text.text, testing::HasSubstr(words));
  }
}

TEST(DegeneracyMarkers, AWeakTranslationIsALineAlongItAndObservedAxesAreDeleted) {
  const auto array = degeneracy_markers(tunnel_along_y(), "imu_link");
  for (std::size_t k = 0; k < 6; ++k) {
    const Marker& marker = array.markers[1 + k];
    EXPECT_EQ(marker.id, static_cast<int>(k));
    EXPECT_EQ(marker.action == Marker::ADD, k == 4);
  }
  const Marker& arrow = array.markers[5];
  ASSERT_EQ(arrow.type, Marker::LINE_LIST);
  ASSERT_EQ(arrow.points.size() % 2, 0U);
  const Eigen::Vector3d shaft = at(arrow.points[1]) - at(arrow.points[0]);
  EXPECT_NEAR(shaft.normalized().y(), 1.0, 1e-12);
  EXPECT_FLOAT_EQ(arrow.color.g, 0.2F);
}

TEST(DegeneracyMarkers, AWeakRotationIsARingAboutIt) {
  degeneracy::Degeneracy d;
  d.axes.col(2) << 0.0, 0.6, 0.8, 0.1, 0.0, 0.0;
  d.localizability[2] = 0.0;
  const Marker ring = degeneracy_markers(d, "imu_link").markers[3];
  ASSERT_FALSE(ring.points.empty());
  for (const geometry_msgs::Point& p : ring.points) {
    EXPECT_NEAR(at(p).dot(Eigen::Vector3d(0.0, 0.6, 0.8)), 0.0, 1e-12);
    EXPECT_NEAR(at(p).norm(), 2.0, 1e-12);
  }
}

TEST(DegeneracyMarkers, EveryMarkerHasItsOwnNameAndDisappearsByItself) {
  std::set<std::pair<std::string, int>> names;
  for (const Marker& marker : degeneracy_markers(tunnel_along_y(), "imu_link").markers) {
    EXPECT_TRUE(names.insert({marker.ns, marker.id}).second);
    EXPECT_GT(marker.lifetime.toSec(), 0.0);
    EXPECT_GT(marker.color.a, 0.0F);
  }
}

TEST(DegeneracyMarkers, AnAxisOfZerosDoesNoHarm) {
  degeneracy::Degeneracy d;
  d.axes.setZero();
  d.localizability.setZero();
  for (const Marker& marker : degeneracy_markers(d, "imu_link").markers) {
    for (const geometry_msgs::Point& p : marker.points) EXPECT_TRUE(at(p).allFinite());
  }
}

}  // namespace
}  // namespace fdi_lio::ros_bridge
