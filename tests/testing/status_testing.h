#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg::testing {

inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <class T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

}  // namespace pepeseg::testing

// Both take an absl::Status or an absl::StatusOr.
#define EXPECT_OK(expr) \
  EXPECT_THAT(::pepeseg::testing::StatusOf(expr).ToString(), ::testing::StrEq("OK"))
#define ASSERT_OK(expr) \
  ASSERT_THAT(::pepeseg::testing::StatusOf(expr).ToString(), ::testing::StrEq("OK"))

// Fails unless the status has this code and a message that contains `substring`.
#define EXPECT_STATUS(expr, expected_code, substring)                                \
  do {                                                                               \
    const auto& status_result = (expr);                                              \
    const absl::Status status_got = ::pepeseg::testing::StatusOf(status_result);     \
    EXPECT_EQ(status_got.code(), expected_code) << status_got.ToString();            \
    EXPECT_THAT(std::string(status_got.message()), ::testing::HasSubstr(substring)); \
  } while (false)

#define PEPESEG_TESTING_CONCAT_INNER(a, b) a##b
#define PEPESEG_TESTING_CONCAT(a, b) PEPESEG_TESTING_CONCAT_INNER(a, b)

// Declares or assigns `lhs` from a StatusOr; ends the test when it holds an error.
// NOLINTBEGIN(bugprone-macro-parentheses): `lhs` may be a declaration.
#define ASSERT_OK_AND_ASSIGN(lhs, expr) \
  PEPESEG_ASSERT_OK_AND_ASSIGN_INNER(PEPESEG_TESTING_CONCAT(status_or_, __LINE__), lhs, expr)
#define PEPESEG_ASSERT_OK_AND_ASSIGN_INNER(status_or, lhs, expr) \
  auto status_or = (expr);                                       \
  ASSERT_OK(status_or);                                          \
  lhs = std::move(status_or).value()
// NOLINTEND(bugprone-macro-parentheses)
