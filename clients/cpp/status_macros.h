#pragma once

// The client's own two macros: it sees the contract only, not core.
#define RETURN_IF_ERROR(expression)                                         \
  do {                                                                      \
    if (absl::Status status_ = (expression); !status_.ok()) return status_; \
  } while (false)

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
