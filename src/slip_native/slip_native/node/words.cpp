#include "words.hpp"

#include <cstdio>
#include <iterator>

#include "slip_vic_words.h"

static std::string number(const std::string &format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, ("%" + format).c_str(), value);
  return text;
}

template <size_t Count>
static std::string word(const char *const (&words)[Count], int64_t k) {
  return k >= 0 && k < static_cast<int64_t>(Count) ? words[k] : "";
}

std::string joint_of(int64_t which, const std::vector<std::string> &joint_names) {
  if (which < 0) return "the pad";
  return which < static_cast<int64_t>(joint_names.size()) ? joint_names[static_cast<size_t>(which)] : "";
}

static std::string filled(const std::string &form, const SlipVic_WhyRecord &why,
                          const std::vector<std::string> &joint_names);

static std::string missing_in(const SlipVic_WhyRecord &why, const std::vector<std::string> &joint_names) {
  std::string text;
  for (size_t bit = 0; bit < std::size(slip_vic_missing_words); ++bit)
    if (why.which >> bit & 1)
      text += (text.empty() ? "" : ", ") + filled(slip_vic_missing_words[bit], why, joint_names);
  return text;
}

static std::string field(const std::string &name, const std::string &format, const SlipVic_WhyRecord &why,
                         const std::vector<std::string> &joint_names) {
  if (name == "value") return number(format, why.value);
  if (name == "limit") return number(format, why.limit);
  if (name == "which") return std::to_string(why.which);
  if (name == "joint") return joint_of(why.which, joint_names);
  if (name == "fault") return word(slip_vic_reason_words, why.fault);
  if (name == "it") return why.fault ? " (it " + word(slip_vic_reason_words, why.fault) + ")" : "";
  if (name == "missing") return missing_in(why, joint_names);
  if (name == "mistake") return filled(word(slip_vic_mistake_words, why.which), why, joint_names);
  return word(slip_vic_sensor_words, why.which);
}

static std::string filled(const std::string &form, const SlipVic_WhyRecord &why,
                          const std::vector<std::string> &joint_names) {
  std::string text;
  for (size_t at = 0; at < form.size();) {
    const size_t open = form.find('{', at), close = form.find('}', at);
    text += form.substr(at, open - at);
    if (open == std::string::npos) break;
    const std::string inside = form.substr(open + 1, close - open - 1);
    const size_t colon = inside.find(':');
    text += field(inside.substr(0, colon), colon == std::string::npos ? "" : inside.substr(colon + 1), why, joint_names);
    at = close + 1;
  }
  return text;
}

std::string describe(const SlipVic_WhyRecord &why, const std::vector<std::string> &joint_names) {
  const std::string text = filled(word(slip_vic_reason_words, why.reason), why, joint_names);
  return why.over ? "resumes after: " + text : text;
}
