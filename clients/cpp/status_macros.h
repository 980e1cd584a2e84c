#pragma once

// Pass errors on to the caller. core/base has the same macros, but the client library depends on
// the contract only.

// Returns the status of `expression` if it is an error.
#define RETURN_IF_ERROR(expression)                                         \
  do {                                                                      \
    if (absl::Status status_ = (expression); !status_.ok()) return status_; \
  } while (false)

// Assigns the value of `expression`, an absl::StatusOr, to `target`; returns its status if it is an
// error. It expands to several statements, so an `if` around it needs braces.
// NOLINTBEGIN(bugprone-macro-parentheses): `target` may be a declaration.
#define ASSIGN_OR_RETURN_JOIN(a, b) a##b
#define ASSIGN_OR_RETURN_NAME(a, b) ASSIGN_OR_RETURN_JOIN(a, b)
#define ASSIGN_OR_RETURN_WITH(result, target, expression) \
  auto result = (expression);                             \
  if (!(result).ok()) return std::move(result).status();  \
  target = *std::move(result)
#define ASSIGN_OR_RETURN(target, expression) \
  ASSIGN_OR_RETURN_WITH(ASSIGN_OR_RETURN_NAME(result_, __LINE__), target, expression)
// NOLINTEND(bugprone-macro-parentheses)
