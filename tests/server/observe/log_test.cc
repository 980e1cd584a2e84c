#include "server/observe/log.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/time/clock.h"

namespace pepeseg {
namespace {

// Returns what `write` writes to standard error.
template <typename Write>
std::string LinesOf(Write write) {
  ::testing::internal::CaptureStderr();
  write();
  spdlog::default_logger()->flush();
  std::string lines = ::testing::internal::GetCapturedStderr();
  ConfigureLog(LogFormat::kText);
  return lines;
}

TEST(Log, WritesOneJsonObjectPerLineForAnyMessage) {
  const std::string lines = LinesOf([] {
    ConfigureLog(LogFormat::kJson);
    spdlog::warn("a \"quote\"\nand a line, {}", "\xff not UTF-8");
  });
  ASSERT_EQ(std::count(lines.begin(), lines.end(), '\n'), 1) << lines;
  const auto json = nlohmann::json::parse(lines);
  EXPECT_EQ(json["level"], "warning");
  EXPECT_EQ(json["message"], "a \"quote\"\nand a line, \xef\xbf\xbd not UTF-8");
  absl::Time time;
  std::string error;
  const auto text = json["time"].get<std::string>();
  EXPECT_TRUE(absl::ParseTime(absl::RFC3339_full, text, &time, &error)) << text << error;
  EXPECT_EQ(text.back(), 'Z');
  EXPECT_LT(absl::Now() - time, absl::Minutes(1));
  EXPECT_FALSE(json.contains("request_id"));
}

TEST(Log, TakesFieldsFromTheInnermostScopeThenTheProcess) {
  const std::string lines = LinesOf([] {
    LogFields process;
    process.job = "j3";
    process.trace_id = "t";
    ConfigureLog(LogFormat::kJson, process);
    LogFields outer;
    outer.request_id = "one";
    LogFields inner;
    inner.request_id = "two";
    inner.duration = absl::Milliseconds(1500);
    const LogScope scope(outer);
    {
      const LogScope nested(inner);
      spdlog::info("in");
    }
    spdlog::info("jobs/j12: out");
  });
  const size_t end = lines.find('\n');
  const auto in = nlohmann::json::parse(lines.substr(0, end));
  EXPECT_EQ(in["request_id"], "two");
  EXPECT_EQ(in["duration"], 1.5);
  EXPECT_EQ(in["job"], "j3");
  EXPECT_EQ(in["trace_id"], "t");
  const auto out = nlohmann::json::parse(lines.substr(end + 1));
  EXPECT_EQ(out["request_id"], "one");
  EXPECT_EQ(out["job"], "j12");
  EXPECT_FALSE(out.contains("duration"));
}

TEST(Log, ShowsTheJobAndItsTraceInText) {
  const std::string lines = LinesOf([] {
    LogFields process;
    process.job = "j3";
    process.trace_id = "0af7";
    ConfigureLog(LogFormat::kText, process);
    spdlog::info("stage reconstruct begins");
  });
  EXPECT_NE(lines.find("[info] [jobs/j3] [trace 0af7] stage reconstruct begins\n"),
            std::string::npos)
      << lines;
}

TEST(LogFormatOf, AcceptsTwoNames) {
  EXPECT_EQ(LogFormatOf("text"), LogFormat::kText);
  EXPECT_EQ(LogFormatOf("json"), LogFormat::kJson);
  EXPECT_EQ(LogFormatOf("xml"), std::nullopt);
}

constexpr char kGood[] = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

TEST(Traceparent, IsParsedStrictly) {
  const auto trace = ParseTraceparent(kGood);
  ASSERT_TRUE(trace.has_value());
  EXPECT_EQ(trace->trace_id, "4bf92f3577b34da6a3ce929d0e0e4736");
  EXPECT_EQ(trace->parent_id, "00f067aa0ba902b7");
  EXPECT_EQ(trace->ToString(), kGood);
  for (const char* bad : {"", "00", "01-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
                          "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
                          "00-00000000000000000000000000000000-00f067aa0ba902b7-01",
                          "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
                          "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
                          "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-0g",
                          "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-",
                          "00-4bf92f3577b34da6a3ce929d0e0e473-600f067aa0ba902b7-01",
                          "00_4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01"}) {
    EXPECT_FALSE(ParseTraceparent(bad).has_value()) << bad;
  }
}

TEST(Traceparent, KeepsTheTraceInChildren) {
  const TraceContext parent = *ParseTraceparent(kGood);
  const TraceContext child = ChildOf(parent);
  EXPECT_EQ(child.trace_id, parent.trace_id);
  EXPECT_NE(child.parent_id, parent.parent_id);
  EXPECT_TRUE(ParseTraceparent(child.ToString()).has_value());
  EXPECT_NE(NewTrace().trace_id, NewTrace().trace_id);
  EXPECT_TRUE(ParseTraceparent(NewTrace().ToString()).has_value());
}

TEST(RequestId, IsShortAndPlain) {
  EXPECT_TRUE(IsRequestId("a-B_9."));
  EXPECT_TRUE(IsRequestId(std::string(64, 'x')));
  for (const std::string& bad : {std::string(), std::string(65, 'x'), std::string("a b"),
                                 std::string("a\n"), std::string("\xc3\xa9")}) {
    EXPECT_FALSE(IsRequestId(bad)) << bad;
  }
  EXPECT_TRUE(IsRequestId(NewRequestId()));
}

}  // namespace
}  // namespace pepeseg
