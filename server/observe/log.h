#pragma once

#include <optional>
#include <string>

#include "absl/time/time.h"

namespace pepeseg {

// What a line is about, beside its message; empty: nothing of the kind.
struct LogFields {
  std::string request_id;
  std::string trace_id;
  std::string job;  // its id, "j12"
  std::string method;
  std::string code;
  std::optional<absl::Duration> duration;
};

enum class LogFormat { kText, kJson };

// Of "text" or "json"; none: it is neither.
std::optional<LogFormat> LogFormatOf(const std::string& name);

// All lines of the process go to standard error from now on, each a text for a person or an object
// of JSON: "time" (RFC 3339, UTC), "level", "message", and the fields that are there ("duration" in
// seconds). `process`: fields of every line that has none of its own. A message that begins with
// "jobs/ID: " has the field "job" without being told.
void ConfigureLog(LogFormat format, const LogFields& process = {});

// The lines that this thread writes while it lives have these fields, which must outlive it. Scopes
// nest: the inner one counts.
class LogScope {
 public:
  explicit LogScope(const LogFields& fields);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  const LogFields* const outer_;
};

}  // namespace pepeseg
