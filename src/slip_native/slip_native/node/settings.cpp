#include "settings.hpp"

#include <fstream>
#include <iterator>

#include <rcl_yaml_param_parser/parser.h>
#include <rcutils/allocator.h>
#include <rcutils/error_handling.h>

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

/* The parameters of the only node in a parameter file. */
class Parameters {
 public:
  explicit Parameters(const std::string &path) : path_(path), all_(rcl_yaml_node_struct_init(rcutils_get_default_allocator())) {
    const bool read = all_ != nullptr && rcl_parse_yaml_file(path.c_str(), all_);
    const std::string why = read ? "" : rcutils_get_error_string().str;
    rcutils_reset_error();
    if (!read || all_->num_nodes != 1) throw InputError(path, read ? "other nodes" : why, "the controller's parameters");
  }
  ~Parameters() { rcl_yaml_node_struct_fini(all_); }
  Parameters(const Parameters &) = delete;
  Parameters &operator=(const Parameters &) = delete;

  std::string text(const char *name) const {
    const rcl_variant_t *found = find(name);
    return found != nullptr && found->string_value != nullptr ? found->string_value : refuse(name, "a text");
  }
  bool flag(const char *name) const { return *found(find(name)->bool_value, name, "true or false"); }
  long whole(const char *name) const { return *found(find(name)->integer_value, name, "a whole number"); }
  double number(const char *name) const { return *found(find(name)->double_value, name, "a number"); }
  std::vector<double> numbers(const char *name) const { /* none where it is left out */
    const rcl_variant_t *given = find(name);
    const rcl_double_array_t *list = given == nullptr ? nullptr : given->double_array_value;
    return list == nullptr ? std::vector<double>() : std::vector<double>(list->values, list->values + list->size);
  }
  std::vector<std::string> texts(const char *name) const {
    const rcutils_string_array_t *list = found(find(name)->string_array_value, name, "a list of names");
    return {list->data, list->data + list->size};
  }

 private:
  const rcl_variant_t *find(const std::string &name) const {
    static const rcl_variant_t none{};
    const rcl_node_params_t &node = all_->params[0];
    for (size_t k = 0; k < node.num_params; ++k)
      if (name == node.parameter_names[k]) return &node.parameter_values[k];
    return &none;
  }
  template <class Value>
  const Value *found(const Value *value, const char *name, const char *expected) const {
    if (value == nullptr) refuse(name, expected);
    return value;
  }
  std::string refuse(const char *name, const char *expected) const {
    throw InputError(path_ + ": parameter " + name, "none, or another kind", expected, "export again");
  }

  std::string path_;
  rcl_params_t *all_;
};

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

  const Parameters given(folder + "/controller.yaml");
  s.joint_names = given.texts("joint_names");
  const size_t n = s.joint_names.size();
  if (static_cast<int64_t>(n) != s.config[0].law.joints)
    throw InputError(folder + "/controller.yaml: joint_names", std::to_string(n) + " joints",
                     std::to_string(s.config[0].law.joints), "export again");
  s.armature = given.numbers("drive.armature");
  if (s.armature.size() != n) s.armature.assign(n, s.armature.empty() ? 0.0 : s.armature[0]);
  const std::vector<double> gravity = given.numbers("gravity");
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
  if (!given.flag("auto_activate"))
    throw InputError("auto_activate", "false", "true: the native node has no lifecycle", "use slip_vic_controller_node");
  s.contacts = static_cast<int>(s.config[0].law.contacts);
  s.subscribers = given.whole("expected_subscribers");
  return s;
}
