#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace pepeseg {

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
