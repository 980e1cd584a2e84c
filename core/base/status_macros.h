#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// The two status macros that the code uses. Debian's Abseil (20220623) has none.

// Evaluates `expr`, an absl::Status, and returns it from the current function unless it is OK.
#define RETURN_IF_ERROR(expr)                                                   \
  do {                                                                          \
    if (absl::Status status_macro_status = (expr); !status_macro_status.ok()) { \
      return status_macro_status;                                               \
    }                                                                           \
  } while (false)

#define PEPESEG_STATUS_MACRO_CONCAT_INNER(a, b) a##b
#define PEPESEG_STATUS_MACRO_CONCAT(a, b) PEPESEG_STATUS_MACRO_CONCAT_INNER(a, b)

// Evaluates `expr`, an absl::StatusOr. Returns its status from the current function unless it is
// OK, else moves its value into `lhs`. Expands to several statements: not for an `if` without
// braces. NOLINTBEGIN(bugprone-macro-parentheses): `lhs` may be a declaration.
#define ASSIGN_OR_RETURN(lhs, expr) \
  PEPESEG_ASSIGN_OR_RETURN_INNER(PEPESEG_STATUS_MACRO_CONCAT(status_or_, __LINE__), lhs, expr)
#define PEPESEG_ASSIGN_OR_RETURN_INNER(status_or, lhs, expr) \
  auto status_or = (expr);                                   \
  if (!status_or.ok()) return status_or.status();            \
  lhs = std::move(status_or).value()
// NOLINTEND(bugprone-macro-parentheses)
