#include "parameter_server.hpp"

#include <algorithm>
#include <chrono>

/* A request may name every parameter once: a longer one would delay the control cycle. */
static size_t most() { return parameter_infos().size(); }

static std::string text_of(const rosidl_runtime_c__String &from) { return {from.data, from.size}; }

template <class Item, class Sequence>
static std::vector<Item> list_of(const Sequence &from) {
  return std::vector<Item>(from.data, from.data + from.size);
}

static void require(bool made) {
  if (!made) throw std::bad_alloc();
}

static Value value_of(const rcl_interfaces__msg__ParameterValue &from) {
  switch (from.type) {
    case 1: return from.bool_value;
    case 2: return from.integer_value;
    case 3: return from.double_value;
    case 4: return text_of(from.string_value);
    case 5: return list_of<uint8_t>(from.byte_array_value);
    case 6: return list_of<bool>(from.bool_array_value);
    case 7: return list_of<int64_t>(from.integer_array_value);
    case 8: return list_of<double>(from.double_array_value);
    case 9: {
      std::vector<std::string> texts;
      for (size_t k = 0; k < from.string_array_value.size; ++k) texts.push_back(text_of(from.string_array_value.data[k]));
      return texts;
    }
    default: return {};
  }
}

/* Write a value to an empty message; the controller's parameters have these types only. */
static void put(rcl_interfaces__msg__ParameterValue &to, const Value &value) {
  to.type = static_cast<uint8_t>(value.index());
  if (const auto *flag = std::get_if<bool>(&value)) to.bool_value = *flag;
  if (const auto *whole = std::get_if<int64_t>(&value)) to.integer_value = *whole;
  if (const auto *number = std::get_if<double>(&value)) to.double_value = *number;
  if (const auto *text = std::get_if<std::string>(&value)) ros::set(to.string_value, *text);
  if (const auto *numbers = std::get_if<std::vector<double>>(&value))
    ros::set(to.double_array_value, numbers->data(), numbers->size());
  if (const auto *texts = std::get_if<std::vector<std::string>>(&value)) ros::set(to.string_array_value, *texts);
  if (const auto *flags = std::get_if<std::vector<bool>>(&value)) {
    require(rosidl_runtime_c__boolean__Sequence__init(&to.bool_array_value, flags->size()));
    std::copy(flags->begin(), flags->end(), to.bool_array_value.data);
  }
}

static void describe(rcl_interfaces__msg__ParameterDescriptor &to, const ParameterInfo &info, const Value &value) {
  ros::set(to.name, info.name);
  ros::set(to.description, info.description);
  ros::set(to.additional_constraints, info.constraint);
  to.type = static_cast<uint8_t>(value.index()), to.read_only = !info.live;
  if (std::holds_alternative<double>(value)) {
    require(rcl_interfaces__msg__FloatingPointRange__Sequence__init(&to.floating_point_range, 1));
    to.floating_point_range.data[0].from_value = info.least, to.floating_point_range.data[0].to_value = info.most;
  } else if (std::holds_alternative<int64_t>(value) && *info.constraint == '\0') {
    require(rcl_interfaces__msg__IntegerRange__Sequence__init(&to.integer_range, 1));
    auto &range = to.integer_range.data[0];
    range.from_value = static_cast<int64_t>(info.least), range.to_value = static_cast<int64_t>(info.most), range.step = 1;
  }
}

/* Return the parameters that a request names; none if one is unknown, as rclpy does. */
static std::vector<const ParameterInfo *> named(const rosidl_runtime_c__String__Sequence &names) {
  std::vector<const ParameterInfo *> found;
  for (size_t k = 0; k < names.size && names.size <= most(); ++k) {
    found.push_back(parameter_info(text_of(names.data[k])));
    if (found.back() == nullptr) return {};
  }
  return found;
}

static std::string too_many(size_t count) {
  return InputError("set_parameters", std::to_string(count) + " values", "at most " + std::to_string(most())).what();
}

static bool listed(const std::string &name, const std::vector<std::string> &prefixes, uint64_t depth) {
  const auto near = [depth](const std::string &rest) {
    return static_cast<uint64_t>(std::count(rest.begin(), rest.end(), '.')) < depth;
  };
  if (prefixes.empty()) return depth == 0 || near(name);
  return std::any_of(prefixes.begin(), prefixes.end(), [&](const std::string &prefix) {
    if (name == prefix) return true;
    return name.rfind(prefix + ".", 0) == 0 && (depth == 0 || near(name.substr(prefix.size() + 1)));
  });
}

ParameterServer::ParameterServer(ros::Node &ros, Session &session, std::vector<std::unique_ptr<ros::AnyService>> *services)
    : session_(session),
      name_(rcl_node_get_name(&ros.node)),
      full_name_(rcl_node_get_fully_qualified_name(&ros.node)),
      events_(ros, "/parameter_events", {true, false, 1000}) {
  const auto value = [this](const ParameterInfo *info) -> const Value & { return session_.parameters().value(info->name); };
  services->push_back(ros::serve<ros::GetParameters>(ros, "~/get_parameters", [value](const auto &request, auto &response) {
    const auto infos = named(request.names);
    require(rcl_interfaces__msg__ParameterValue__Sequence__init(&response.values, infos.size()));
    for (size_t k = 0; k < infos.size(); ++k) put(response.values.data[k], value(infos[k]));
  }));
  services->push_back(ros::serve<ros::GetParameterTypes>(ros, "~/get_parameter_types", [value](const auto &request, auto &response) {
    const auto infos = named(request.names);
    require(rosidl_runtime_c__uint8__Sequence__init(&response.types, infos.size()));
    for (size_t k = 0; k < infos.size(); ++k) response.types.data[k] = static_cast<uint8_t>(value(infos[k]).index());
  }));
  services->push_back(ros::serve<ros::DescribeParameters>(ros, "~/describe_parameters", [value](const auto &request, auto &response) {
    const auto infos = named(request.names);
    require(rcl_interfaces__msg__ParameterDescriptor__Sequence__init(&response.descriptors, infos.size()));
    for (size_t k = 0; k < infos.size(); ++k) describe(response.descriptors.data[k], *infos[k], value(infos[k]));
  }));
  services->push_back(ros::serve<ros::ListParameters>(ros, "~/list_parameters", [](const auto &request, auto &response) {
    std::vector<std::string> prefixes, names, groups;
    for (size_t k = 0; k < std::min(request.prefixes.size, most()); ++k) prefixes.push_back(text_of(request.prefixes.data[k]));
    for (const ParameterInfo &info : parameter_infos()) {
      const std::string name = info.name, group = name.substr(0, std::max<size_t>(name.rfind('.') + 1, 1) - 1);
      if (!listed(name, prefixes, request.depth)) continue;
      names.push_back(name);
      if (!group.empty() && std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
    }
    ros::set(response.result.names, names);
    ros::set(response.result.prefixes, groups);
  }));
  services->push_back(ros::serve<ros::SetParameters>(ros, "~/set_parameters", [this](const auto &request, auto &response) {
    require(rcl_interfaces__msg__SetParametersResult__Sequence__init(&response.results, request.parameters.size));
    const size_t count = request.parameters.size;
    for (size_t k = 0; k < count; ++k) {
      auto &result = response.results.data[k];
      const std::string why = count > most() ? too_many(count) : set(&request.parameters.data[k], 1);
      result.successful = why.empty();
      ros::set(result.reason, why);
    }
  }));
  services->push_back(ros::serve<ros::SetParametersAtomically>(
      ros, "~/set_parameters_atomically", [this](const auto &request, auto &response) {
        const size_t count = request.parameters.size;
        const std::string why = count > most() ? too_many(count) : set(request.parameters.data, count);
        response.result.successful = why.empty();
        ros::set(response.result.reason, why);
      }));
}

/* Set parameters together; return the reason of a refusal, empty if they are set. */
std::string ParameterServer::set(const rcl_interfaces__msg__Parameter *given, size_t count) {
  Values values;
  for (size_t k = 0; k < count; ++k) values[text_of(given[k].name)] = value_of(given[k].value);
  try {
    session_.set_parameters(values, name_);
  } catch (const std::runtime_error &why) { /* Refused or InputError */
    return why.what();
  }
  auto &event = *events_.message;
  const int64_t wall_ns = std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  ros::set(event.stamp, wall_ns);
  ros::set(event.node, full_name_);
  rcl_interfaces__msg__Parameter__Sequence__fini(&event.changed_parameters);
  require(rcl_interfaces__msg__Parameter__Sequence__init(&event.changed_parameters, values.size()));
  size_t k = 0;
  for (const auto &[name, value] : values) {
    ros::set(event.changed_parameters.data[k].name, name);
    put(event.changed_parameters.data[k++].value, value);
  }
  events_.send();
  return "";
}
