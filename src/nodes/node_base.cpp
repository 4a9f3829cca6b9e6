#include "node_base.hpp"

#include <sstream>
#include <vector>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"

namespace fdi_lio::nodes {

namespace {

std::vector<std::string> split(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

}  // namespace

void NodeBase::onInit() {
  ros::NodeHandle& handle = getPrivateNodeHandle();
  try {
    config_ = load_config(handle.param("config", std::string()), split(handle.param("set", std::string())));
  } catch (const Error& error) {
    NODELET_FATAL("%s", error.what());
    throw;
  }
  threads_ = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                   static_cast<std::size_t>(config_.threads));
  updater_ = std::make_unique<diagnostic_updater::Updater>(getNodeHandle(), handle, getName());
  updater_->setHardwareID("none");
  updater_->add("status", this, &NodeBase::diagnose);
  start();
  timer_ = getNodeHandle().createSteadyTimer(ros::WallDuration(0.02), [this](const ros::SteadyTimerEvent&) {
    check_waiting();
    log_notices();
    updater_->update();
  });
}

void NodeBase::log_notices() {
  for (const Notice& notice : reporter_.take_new()) {
    const std::string text =
        notice.count > 1 ? notice.text + " (" + std::to_string(notice.count) + " times so far)" : notice.text;
    switch (notice.severity) {
      case Severity::kInfo:
        NODELET_INFO("%s", text.c_str());
        break;
      case Severity::kWarning:
        NODELET_WARN("%s", text.c_str());
        break;
      case Severity::kError:
        NODELET_ERROR("%s", text.c_str());
        break;
    }
  }
}

void NodeBase::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
  for (const auto& [key, notice] : reporter_.notices()) {
    status.add(key, std::to_string(notice.count) + " x " + notice.text);
    if (notice.severity == Severity::kWarning)
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, key);
    if (notice.severity == Severity::kError)
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::ERROR, key);
  }
  fill_diagnostics(&status);
}

}  // namespace fdi_lio::nodes
