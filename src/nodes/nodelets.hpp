#pragma once

#include "degeneracy_estimation.hpp"
#include "feature_extraction.hpp"
#include "imu_preintegration.hpp"
#include "mapping_optimization.hpp"
#include "scan_deskew.hpp"
