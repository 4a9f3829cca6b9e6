# Everything that runs: after `cmake --install` the package works from its prefix as it does from the source tree.
install(
  TARGETS fdi_lio_core fdi_lio_nodelets fdi_lio_ros fdi_lio_simulation
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION}
)
install(
  TARGETS benchmark_pose_graph check_bag degeneracy_estimation evaluate_moving_points evaluate_registration feature_extraction
          imu_preintegration mapping_optimization offline_slam optimise_session
          parameter_table scan_deskew simulate_bag
  RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION}
)
install(
  DIRECTORY include/${PROJECT_NAME}/
  DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION}
  FILES_MATCHING PATTERN "*.hpp"
)
install(FILES nodelets.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(DIRECTORY config launch rviz DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})

file(GLOB python_scripts CONFIGURE_DEPENDS scripts/*.py)
# Not catkin_install_python: its relays in the devel space do not find fdi_lio_scripts beside the script.
install(PROGRAMS ${python_scripts} DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(
  DIRECTORY scripts/fdi_lio_scripts
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION}
  FILES_MATCHING PATTERN "*.py"
)
