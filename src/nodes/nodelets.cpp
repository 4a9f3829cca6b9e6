#include "nodelets.hpp"

#include <pluginlib/class_list_macros.hpp>

PLUGINLIB_EXPORT_CLASS(fdi_lio::nodes::ImuPreintegration, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fdi_lio::nodes::ScanDeskew, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fdi_lio::nodes::FeatureExtraction, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fdi_lio::nodes::DegeneracyEstimation, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fdi_lio::nodes::MappingOptimization, nodelet::Nodelet)
