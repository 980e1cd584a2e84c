#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace pepeseg {

// W3C Trace Context, version 00: which trace a call belongs to, and which span of it is at work.
struct TraceContext {
  std::string trace_id;   // 32 lower-case hex digits, not all 0
  std::string parent_id;  // 16, likewise
  std::string flags;      // 2

  // "00-TRACE-PARENT-FLAGS", the header `traceparent`.
  std::string ToString() const;
};

// None: it is not exactly that.
std::optional<TraceContext> ParseTraceparent(std::string_view header);
// A trace of its own, sampled by nobody so far.
TraceContext NewTrace();
// A new span of the same trace.
TraceContext ChildOf(const TraceContext& parent);

// Whether a client's own id of a request is taken over: 1 to 64 of [A-Za-z0-9._-].
bool IsRequestId(std::string_view text);
std::string NewRequestId();

}  // namespace pepeseg
