#include "settings.hpp"

#include <fstream>
#include <iterator>

#include "errors.hpp"

namespace {

std::string read_file(const std::string &path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path, "no such file", "a folder of `slip-vic export`");
  return {std::istreambuf_iterator<char>(file), {}};
}

template <class Item>
std::vector<Item> read_records(const std::string &path) {
  const std::string bytes = read_file(path);
  if (bytes.empty() || bytes.size() % sizeof(Item) != 0)
    throw InputError(path, std::to_string(bytes.size()) + " bytes", "whole records of " + std::to_string(sizeof(Item)),
                     "export and build again");
  std::vector<Item> items(bytes.size() / sizeof(Item));
  std::copy(bytes.begin(), bytes.end(), reinterpret_cast<char *>(items.data()));
  return items;
}

}  // namespace

size_t Settings::rows() const {
  const size_t fixed = sizeof(SlipVic_TaskState) + sizeof(SlipVic_ArmState);
  return (state.size() * sizeof(double) - fixed) / sizeof(SlipVic_Row);
}

Settings read_settings(const std::string &folder) {
  Settings s;
  s.config = read_records<SlipVic_ControllerConfig>(folder + "/controller.bin");
  s.state = read_records<double>(folder + "/state.bin");
  s.urdf = read_file(folder + "/arm.urdf");
  if (s.config.size() != 1)
    throw InputError(folder, std::to_string(s.config.size()) + " arms", "one",
                     "the native node controls a single arm: use slip_vic_controller_node, or the library");
  const size_t size = s.state.size() * sizeof(double), fixed = sizeof(SlipVic_TaskState) + sizeof(SlipVic_ArmState);
  if (size < fixed || (size - fixed) % sizeof(SlipVic_Row) != 0)
    throw InputError(folder + "/state.bin", std::to_string(size) + " bytes", "the state of one arm", "export again");

  s.parameters = Parameters(folder + "/controller.yaml");
  const Parameters &given = s.parameters;
  s.joint_names = given.texts("joint_names");
  const size_t n = s.joint_names.size();
  if (static_cast<int64_t>(n) != s.config[0].law.joints)
    throw InputError(folder + "/controller.yaml: joint_names", std::to_string(n) + " joints",
                     std::to_string(s.config[0].law.joints), "export again");
  s.armature = std::get<std::vector<double>>(given.value("drive.armature"));
  if (s.armature.size() != n) s.armature.assign(n, s.armature.empty() ? 0.0 : s.armature[0]);
  const std::vector<double> &gravity = given.numbers("gravity");
  if (gravity.size() != 3) throw InputError(folder + "/controller.yaml: gravity", "no vector", "three numbers");
  std::copy(gravity.begin(), gravity.end(), s.gravity.begin());
  s.ee_frame = given.text("ee_frame");
  s.wrench_frame = given.text("wrench.frame");
  s.interface = given.text("command.interface");
  s.slip_input = given.text("slip_input");
  s.trajectory = given.text("trajectory.kind");
  s.governor = given.text("governor.mode");
  s.goal_duration_s = given.number("trajectory.duration_s");
  s.lockstep = given.text("mode") == "lockstep";
  s.effort_array = given.flag("publish_effort_array");
  s.auto_activate = given.flag("auto_activate");
  s.contacts = static_cast<int>(s.config[0].law.contacts);
  s.subscribers = given.whole("expected_subscribers");
  return s;
}
