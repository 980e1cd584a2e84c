#include "server/observe/log.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string_view>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

thread_local const LogFields* fields_of_thread = nullptr;

// Returns the id in "jobs/ID: what happened", or "".
std::string_view JobOf(std::string_view message) {
  constexpr std::string_view kPrefix = "jobs/";
  if (!message.starts_with(kPrefix)) return {};
  message.remove_prefix(kPrefix.size());
  const size_t end = message.find(": ");
  return end == std::string_view::npos ? std::string_view() : message.substr(0, end);
}

class JsonFormatter final : public spdlog::formatter {
 public:
  explicit JsonFormatter(LogFields process) : process_(std::move(process)) {}

  void format(const spdlog::details::log_msg& line, spdlog::memory_buf_t& out) override {
    const std::string_view message(line.payload.data(), line.payload.size());
    const auto level = spdlog::level::to_string_view(line.level);
    nlohmann::ordered_json json = {
        {"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E6SZ", absl::FromChrono(line.time),
                                  absl::UTCTimeZone())},
        {"level", std::string(level.data(), level.size())},
        {"message", message}};
    AddFields(message, json);
    // Replaces bytes that are not UTF-8, which JSON cannot hold.
    const std::string text =
        json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    out.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<formatter> clone() const override {
    return std::make_unique<JsonFormatter>(process_);
  }

 private:
  void AddFields(std::string_view message, nlohmann::ordered_json& json) const {
    static const LogFields kNone;
    const LogFields& own = fields_of_thread == nullptr ? kNone : *fields_of_thread;
    const auto add = [&](const char* name, std::string LogFields::*field) {
      const std::string& value = (own.*field).empty() ? process_.*field : own.*field;
      if (!value.empty()) json[name] = value;
    };
    add("request_id", &LogFields::request_id);
    add("trace_id", &LogFields::trace_id);
    add("job", &LogFields::job);
    if (const std::string_view job = JobOf(message); !job.empty()) json["job"] = job;
    add("method", &LogFields::method);
    add("code", &LogFields::code);
    if (own.duration) json["duration"] = absl::ToDoubleSeconds(*own.duration);
  }

  const LogFields process_;
};

// Returns spdlog's pattern for text. It shows only the fields that are the same in all lines.
std::string TextPattern(const LogFields& process) {
  std::string who;
  if (!process.job.empty()) absl::StrAppend(&who, " [jobs/", process.job, "]");
  if (!process.trace_id.empty()) absl::StrAppend(&who, " [trace ", process.trace_id, "]");
  return absl::StrCat("[%Y-%m-%d %H:%M:%S.%e] [%l]", who, " %v");
}

constexpr size_t kMaxRequestIdBytes = 64;
constexpr size_t kTraceStart = 3, kTraceDigits = 32;
constexpr size_t kParentStart = 36, kParentDigits = 16;
constexpr size_t kFlagsStart = 53, kHeaderBytes = 55;

// Ids need not be unpredictable, only different.
uint64_t RandomWord() {
  thread_local std::mt19937_64 engine = [] {
    std::random_device device;
    std::seed_seq seed{device(), device(), device(), device()};
    return std::mt19937_64(seed);
  }();
  return engine();
}

std::string RandomDigits16() {
  uint64_t word = 0;
  while (word == 0) word = RandomWord();
  return absl::StrCat(absl::Hex(word, absl::kZeroPad16));
}

bool IsLowerHex(std::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f'); });
}

bool IsId(std::string_view text) {
  return IsLowerHex(text) && text.find_first_not_of('0') != std::string_view::npos;
}

}  // namespace

std::optional<LogFormat> LogFormatOf(const std::string& name) {
  if (name == "text") return LogFormat::kText;
  if (name == "json") return LogFormat::kJson;
  return std::nullopt;
}

void ConfigureLog(LogFormat format, const LogFields& process) {
  const spdlog::level::level_enum level = spdlog::get_level();
  auto logger = std::make_shared<spdlog::logger>("pepeseg",
                                                 std::make_shared<spdlog::sinks::stderr_sink_mt>());
  if (format == LogFormat::kJson) {
    logger->set_formatter(std::make_unique<JsonFormatter>(process));
  } else {
    logger->set_formatter(std::make_unique<spdlog::pattern_formatter>(TextPattern(process)));
  }
  logger->set_level(level);
  spdlog::set_default_logger(std::move(logger));
}

LogScope::LogScope(const LogFields& fields) : outer_(fields_of_thread) {
  fields_of_thread = &fields;
}

LogScope::~LogScope() { fields_of_thread = outer_; }

std::string TraceContext::ToString() const {
  return absl::StrCat("00-", trace_id, "-", parent_id, "-", flags);
}

std::optional<TraceContext> ParseTraceparent(std::string_view header) {
  if (header.size() != kHeaderBytes || !header.starts_with("00-") ||
      header[kParentStart - 1] != '-' || header[kFlagsStart - 1] != '-') {
    return std::nullopt;
  }
  const std::string_view trace = header.substr(kTraceStart, kTraceDigits);
  const std::string_view parent = header.substr(kParentStart, kParentDigits);
  const std::string_view flags = header.substr(kFlagsStart);
  if (!IsId(trace) || !IsId(parent) || !IsLowerHex(flags)) return std::nullopt;
  return TraceContext{std::string(trace), std::string(parent), std::string(flags)};
}

TraceContext NewTrace() {
  return {absl::StrCat(RandomDigits16(), RandomDigits16()), RandomDigits16(), "00"};
}

TraceContext ChildOf(const TraceContext& parent) {
  return {parent.trace_id, RandomDigits16(), parent.flags};
}

bool IsRequestId(std::string_view text) {
  return !text.empty() && text.size() <= kMaxRequestIdBytes &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
         });
}

std::string NewRequestId() { return RandomDigits16(); }

}  // namespace pepeseg
