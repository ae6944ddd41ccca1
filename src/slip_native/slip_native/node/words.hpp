/* Why the controller is in its mode, in the words of the Python node. */
#pragma once

#include <string>
#include <vector>

#include "slip_vic.h"

std::string describe(const SlipVic_WhyRecord &why, const std::vector<std::string> &joint_names);
std::string joint_of(int64_t which, const std::vector<std::string> &joint_names);
