#include "samples.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

static const double MOST = 1e3;       /* of anything that a reference may have, in SI units */
static const double LEAST_NORM = 1e-6; /* of a quaternion */

int64_t stamp_of(const builtin_interfaces__msg__Time &stamp) {
  if (stamp.nanosec >= 1'000'000'000u)
    throw InputError("stamp", std::to_string(stamp.nanosec) + " nanoseconds", "less than a second of them");
  return stamp.sec * INT64_C(1'000'000'000) + stamp.nanosec;
}

void JointReader::find(const rosidl_runtime_c__String__Sequence &names) {
  const auto same = [](const std::string &a, const rosidl_runtime_c__String &b) {
    return a.size() == b.size && std::memcmp(a.data(), b.data, b.size) == 0;
  };
  if (!seen_.empty() && std::equal(seen_.begin(), seen_.end(), names.data, names.data + names.size, same)) return;
  seen_.clear();
  for (size_t k = 0; k < names_.size(); ++k) {
    const auto is = [&](const rosidl_runtime_c__String &name) { return same(names_[k], name); };
    if (std::count_if(names.data, names.data + names.size, is) != 1)
      throw InputError("joint state: joint " + names_[k], std::to_string(names.size) + " other names, or it twice",
                       "each of the controller's joints once");
    places_[k] = static_cast<size_t>(std::find_if(names.data, names.data + names.size, is) - names.data);
  }
  for (size_t k = 0; k < names.size; ++k) seen_.emplace_back(names.data[k].data, names.data[k].size);
}

void JointReader::read(const sensor_msgs__msg__JointState &message, JointSample *sample) {
  sample->stamp_ns = stamp_of(message.header.stamp);
  find(message.name);
  const size_t count = message.name.size, n = names_.size();
  if (message.position.size != count || (message.velocity.size != 0 && message.velocity.size != count))
    throw InputError("joint state",
                     std::to_string(count) + " names, " + std::to_string(message.position.size) + " positions, " +
                         std::to_string(message.velocity.size) + " velocities",
                     "one position per name, and one velocity or none at all");
  const bool moves = message.velocity.size == count, pulls = message.effort.size == count;
  sample->position.resize(n), sample->velocity.resize(n), sample->effort.resize(n);
  for (size_t k = 0; k < n; ++k) {
    sample->position[k] = message.position.data[places_[k]];
    sample->velocity[k] = moves ? message.velocity.data[places_[k]] : std::nan("");
    sample->effort[k] = pulls ? message.effort.data[places_[k]] : 0.0;
  }
}

void check_frame(const std_msgs__msg__Header &header, const std::string &frame) {
  const std::string named(header.frame_id.data, header.frame_id.size);
  if (!named.empty() && named != frame) throw InputError("frame_id", named, frame);
}

bool read_flag(const sensor_msgs__msg__JointState &message, double *six) {
  if (message.position.size != message.name.size)
    throw InputError("slip flag",
                     std::to_string(message.name.size) + " names, " + std::to_string(message.position.size) + " positions",
                     "one position per name: 1 slips, 0 holds, NaN unknown");
  bool known = false, slips = false;
  for (size_t k = 0; k < message.position.size; ++k) {
    known = known || std::isfinite(message.position.data[k]);
    slips = slips || (std::isfinite(message.position.data[k]) && message.position.data[k] > 0.5);
  }
  std::fill(six, six + 6, slips ? 1.0 : 0.0);
  return known;
}

static void put(double *to, const geometry_msgs__msg__Vector3 &from) { to[0] = from.x, to[1] = from.y, to[2] = from.z; }

static void put_rotation(double (*R)[3], const geometry_msgs__msg__Quaternion &of) {
  const double norm = std::sqrt(of.x * of.x + of.y * of.y + of.z * of.z + of.w * of.w);
  if (!(std::isfinite(norm) && norm >= LEAST_NORM)) throw InputError("quaternion (x, y, z, w)", "no attitude", "a norm of 1");
  const double x = of.x / norm, y = of.y / norm, z = of.z / norm, w = of.w / norm;
  const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                             {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                             {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  std::memcpy(R, rows, sizeof rows);
}

bool read_displacement(const geometry_msgs__msg__PoseStamped &message, SlipVic_Pose *pose) {
  const auto &p = message.pose.position;
  const auto &q = message.pose.orientation;
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || !(std::isfinite(norm) && norm > LEAST_NORM)) return false;
  pose->position[0] = p.x, pose->position[1] = p.y, pose->position[2] = p.z;
  put_rotation(pose->rotation, q);
  return true;
}

static bool all(const double *values, size_t count, bool (*so)(double)) { return std::all_of(values, values + count, so); }

static Point read_point(const trajectory_msgs__msg__MultiDOFJointTrajectory &message) {
  if (message.points.size == 0 || message.points.data[0].transforms.size == 0)
    throw InputError("reference", "no point with a transform", "one point with one transform");
  const auto &point = message.points.data[0];
  Point read{};
  put(read.motion.position, point.transforms.data[0].translation);
  put_rotation(read.motion.rotation, point.transforms.data[0].rotation);
  if (point.velocities.size > 0) {
    put(read.motion.twist, point.velocities.data[0].linear);
    put(read.motion.twist + 3, point.velocities.data[0].angular);
  }
  if (point.accelerations.size > 0) {
    put(read.motion.acceleration, point.accelerations.data[0].linear);
    put(read.motion.acceleration + 3, point.accelerations.data[0].angular);
  }
  read.after_s = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec;
  return read;
}

Point read_reference(const trajectory_msgs__msg__MultiDOFJointTrajectory &message, bool governed) {
  const Point read = read_point(message);
  const auto small = [](double x) { return !std::isfinite(x) || std::abs(x) <= MOST; };
  const auto finite = [](double x) { return std::isfinite(x); };
  const SlipVic_DesiredMotion &motion = read.motion;
  if (!all(motion.position, 3, small) || !all(motion.twist, 6, small) || !all(motion.acceleration, 6, small))
    throw InputError("reference", "numbers above 1000", "SI units: at most 1000");
  if (!governed) return read;
  const auto &point = message.points.data[0];
  if (point.velocities.size == 0 || point.accelerations.size == 0)
    throw InputError("reference", "a pose alone", "velocities and accelerations too: the governor needs them",
                     "fill them, or send a goal (trajectory.kind goal)");
  if (!all(motion.position, 3, finite) || !all(motion.twist, 6, finite) || !all(motion.acceleration, 6, finite))
    throw InputError("reference", "numbers that are not finite", "finite numbers");
  return read;
}

Point read_goal(const trajectory_msgs__msg__MultiDOFJointTrajectory &message, double duration_s) {
  if (message.points.size != 1)
    throw InputError("goal", std::to_string(message.points.size) + " points", "one, with pose and time_from_start");
  check_frame(message.header, "world");
  Point read = read_point(message);
  if (!all(read.motion.position, 3, [](double x) { return std::isfinite(x); }))
    throw InputError("goal: position", "numbers that are not finite", "finite numbers");
  const auto zero = [](double x) { return x == 0.0; };
  if (!all(read.motion.twist, 6, zero) || !all(read.motion.acceleration, 6, zero))
    throw InputError("goal: velocities", "a motion", "none: a goal is at rest", "leave them out");
  if (read.after_s == 0.0) read.after_s = duration_s;
  if (!(read.after_s > 0.0)) throw InputError("goal: time_from_start", "none", "more than 0");
  return read;
}
