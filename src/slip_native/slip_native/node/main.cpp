/* slip_vic_node FOLDER [--ros-args [-r FROM:=TO]... [-p expected_subscribers:=N]] */
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include <rcl/arguments.h>
#include <rcl_yaml_param_parser/parser.h>
#include <sys/prctl.h>

#include "errors.hpp"
#include "lifecycle.hpp"

static const char *const HELP =
    "usage: slip_vic_node FOLDER [--ros-args [-r FROM:=TO]... [-p expected_subscribers:=N]]\n\n"
    "The controller of one arm, without Python: the topics and services of slip_vic_controller_node.\n"
    "FOLDER is written by `slip-vic export`, with all parameters. Gains and payload can be changed at run time;\n"
    "for other parameters export again.\n";
static const int64_t DELIVERY_NS = 2'000'000'000, HASTE_NS = 100'000'000;

/* The wheels' rcl is linked with its Python bindings, which nothing calls here; elsewhere these two have no meaning. */
extern "C" {
__attribute__((visibility("default"))) void *PyExc_RuntimeError = nullptr;
__attribute__((visibility("default"))) char _Py_TrueStruct[64] = {};
}

static volatile int stop = 0;
static volatile std::sig_atomic_t signal_number = 0;
static void on_signal(int number) { signal_number = number, stop = 1; }

static bool has_parent() {
  const char *wanted = std::getenv("SLIP_VIC_EVENTS");
  return wanted != nullptr && std::strcmp(wanted, "1") == 0;
}

/* Tell the process that has started this one, where it listens, as environment.py; values: further fields of JSON. */
static void emit(const char *kind, const std::string &values) {
  if (!has_parent()) return;
  std::printf("{\"event\": \"%s\"%s}\n", kind, values.c_str());
  std::fflush(stdout);
}

/* Let DDS send on this machine only, by UDP, unless the user has chosen: as environment.py. */
static void choose_transport(const std::string &folder) {
  const auto given = [](const char *name) {
    const char *value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  if (!given("FASTRTPS_DEFAULT_PROFILES_FILE").empty() || !given("FASTDDS_DEFAULT_PROFILES_FILE").empty()) return;
  if (given("ROS_LOCALHOST_ONLY") == "1") {
    setenv("ROS_LOCALHOST_ONLY", "0", 1);
    setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", 1);
  }
  setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", 0);
  const bool here = given("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST" && given("ROS_STATIC_PEERS").empty();
  const std::string rmw = given("RMW_IMPLEMENTATION");
  if (here && (rmw.empty() || rmw.rfind("rmw_fastrtps", 0) == 0)) {
    setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT", 1);
    setenv("FASTRTPS_DEFAULT_PROFILES_FILE", (folder + "/localhost.xml").c_str(), 1);
  } else {
    setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4", 0);
  }
}

/* Take what a ROS command line may change of the settings. */
static void take_overrides(const rcl_arguments_t &arguments, Settings *settings) {
  rcl_params_t *given = nullptr;
  ros::check(rcl_arguments_get_param_overrides(&arguments, &given), "ROS refused the parameters");
  for (size_t node = 0; given != nullptr && node < given->num_nodes; ++node)
    for (size_t k = 0; k < given->params[node].num_params; ++k) {
      const std::string name = given->params[node].parameter_names[k];
      const int64_t *value = given->params[node].parameter_values[k].integer_value;
      if (name != "expected_subscribers" || value == nullptr || *value < 1)
        throw InputError("parameter " + name, "a value", "expected_subscribers alone, at least 1",
                         "the others are those of the export: export again");
      settings->subscribers = *value;
    }
  if (given != nullptr) rcl_yaml_node_struct_fini(given);
}

static int run(int count, char **words) {
  if (count < 2 || words[1][0] == '-') throw InputError("slip_vic_node", "no folder", "one of `slip-vic export`");
  const std::string folder = words[1];
  Settings settings = read_settings(folder);
  choose_transport(folder);
  ros::Node ros(count - 1, words + 1, "slip_vic_controller");
  if (rcl_arguments_get_count_unparsed(&ros.context.global_arguments) > 1)
    throw InputError("slip_vic_node", "more arguments than a folder", "a folder, then --ros-args", "slip_vic_node --help");
  if (rcl_arguments_get_count_unparsed_ros(&ros.context.global_arguments) > 0)
    throw InputError("--ros-args", "an unknown argument", "-r FROM:=TO, -p expected_subscribers:=N");
  take_overrides(ros.context.global_arguments, &settings);
  Lifecycle managed(ros, settings);
  prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0);
  managed.run(stop);
  ControllerNode *node = managed.node();
  if (node == nullptr) return 0;
  node->close(has_parent() && signal_number == SIGINT ? DELIVERY_NS : HASTE_NS);
  emit("done", ", \"cycles\": " + std::to_string(node->cycles()) + ", \"missed\": " + std::to_string(node->missed()));
  return 0;
}

int main(int count, char **words) {
  if (count == 2 && (std::strcmp(words[1], "-h") == 0 || std::strcmp(words[1], "--help") == 0))
    return std::fputs(HELP, stdout), 0;
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) std::signal(number, on_signal);
  std::signal(SIGPIPE, SIG_IGN); /* who read the log may go: the arm does not notice */
  try {
    return run(count, words);
  } catch (const InputError &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  } catch (const ros::Error &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  } catch (const std::exception &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
}
