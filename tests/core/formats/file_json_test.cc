#include "core/formats/file_json.h"

#include <gtest/gtest.h>

#include <string>

#include "nlohmann/json.hpp"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

std::string Nested(int levels) {
  std::string text;
  for (int i = 0; i < levels; ++i) text += i % 2 == 0 ? "[" : "{\"a\":";
  text += "1";
  for (int i = levels - 1; i >= 0; --i) text += i % 2 == 0 ? "]" : "}";
  return text;
}

TEST(ParseFileJson, ReadsValues) {
  ASSERT_OK_AND_ASSIGN(const nlohmann::json json, ParseFileJson(R"({"a": [1, -2, 0.5, null]})"));
  EXPECT_EQ(json["a"].size(), 4u);
  EXPECT_EQ(json["a"][1], -2);
}

TEST(ParseFileJson, RejectsMoreThanSixtyFourLevels) {
  EXPECT_OK(ParseFileJson(Nested(64)));
  EXPECT_STATUS(ParseFileJson(Nested(65)), kInvalidArgument, "is nested deeper than 64 levels");
  EXPECT_STATUS(ParseFileJson("[" + Nested(63) + "," + Nested(64) + "]"), kInvalidArgument,
                "is nested deeper than 64 levels");
  EXPECT_OK(ParseFileJson("[" + Nested(63) + "," + Nested(63) + "]")) << "one after the other";
}

TEST(ParseFileJson, RejectsTextThatIsNotJson) {
  for (const char* text : {"", "[1, 2", "{\"a\"}", "[1] 2", "\xff"}) {
    EXPECT_STATUS(ParseFileJson(text), kInvalidArgument, "is not JSON, or cut short");
  }
}

}  // namespace
}  // namespace pepeseg
