#include "server/observe/trace_context.h"

#include <algorithm>
#include <cstdint>
#include <random>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

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
