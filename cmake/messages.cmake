add_message_files(FILES
  Degeneracy.msg
  DeskewedCloud.msg
  EstimatorState.msg
  Features.msg
  OptimisationStatus.msg
  PreintegratedImu.msg
  ScanInfo.msg
)
generate_messages(DEPENDENCIES geometry_msgs sensor_msgs std_msgs)
