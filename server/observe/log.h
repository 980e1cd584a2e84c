#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "absl/time/time.h"

// The log of a process, and the ids of calls that its lines carry.
namespace pepeseg {

// Fields of a log line in addition to its message. Empty fields are not written.
struct LogFields {
  std::string request_id;
  std::string trace_id;
  std::string job;  // id, as "j12"
  std::string method;
  std::string code;
  std::optional<absl::Duration> duration;
};

enum class LogFormat { kText, kJson };

// Returns the format called "text" or "json", or nullopt for another name.
std::optional<LogFormat> LogFormatOf(const std::string& name);

// Makes spdlog write all lines of the process to standard error, each as text or as a JSON object
// with "time" (RFC 3339, UTC), "level", "message" and the fields that are set ("duration" in
// seconds). `process`: fields for lines that do not set their own. A message that begins with
// "jobs/ID: " gets the field "job" from it.
void ConfigureLog(LogFormat format, const LogFields& process = {});

// Adds fields to the lines that this thread writes while the scope lives. The fields must outlive
// it. Scopes nest; only the innermost one counts.
class LogScope {
 public:
  explicit LogScope(const LogFields& fields);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  const LogFields* const outer_;
};

// W3C Trace Context, version 00: the trace that a call belongs to, and the current span.
struct TraceContext {
  std::string trace_id;   // 32 lower-case hex digits, not all 0
  std::string parent_id;  // 16 lower-case hex digits, not all 0
  std::string flags;      // 2 lower-case hex digits

  // Returns "00-TRACE-PARENT-FLAGS", the header `traceparent`.
  std::string ToString() const;
};

// Returns nullopt unless the header has exactly that form.
std::optional<TraceContext> ParseTraceparent(std::string_view header);
// Returns a new trace that is not sampled.
TraceContext NewTrace();
// Returns a new span of the same trace.
TraceContext ChildOf(const TraceContext& parent);

// Returns whether a client's own request id is accepted: 1 to 64 of [A-Za-z0-9._-].
bool IsRequestId(std::string_view text);
std::string NewRequestId();

}  // namespace pepeseg
