// One node as a process of its own: the nodelet FDI_LIO_NODELET without a manager.
#include "nodelets.hpp"
#include <nodelet/loader.h>
#include <ros/ros.h>

#include "fdi_lio/common/memory.hpp"

int main(int argc, char** argv) {
  fdi_lio::keep_freed_memory();
  ros::init(argc, argv, FDI_LIO_NODE_NAME);
  const boost::function<boost::shared_ptr<nodelet::Nodelet>(const std::string&)> create =
      [](const std::string& /*name*/) { return boost::make_shared<fdi_lio::nodes::FDI_LIO_NODELET>(); };
  nodelet::Loader loader(create);
  const nodelet::V_string arguments(argv + 1, argv + argc);
  try {
    if (!loader.load(ros::this_node::getName(), FDI_LIO_NODE_NAME, ros::names::getRemappings(), arguments))
      return 1;
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", FDI_LIO_NODE_NAME, error.what());
    return 1;
  }
  ros::spin();
  return 0;
}
