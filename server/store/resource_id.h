#pragma once

#include <string_view>

// The rules of ids that clients choose.
namespace pepeseg {

// Returns whether `id` may be a project's id: 1 to 63 lower-case letters, digits and '-', starting
// with a letter and not ending with '-'.
bool IsRfc1034Label(std::string_view id);

// Returns whether `id` may be the id of a scene or label: 1 to 63 ASCII letters, digits, '_', '.'
// and '-', starting with a letter or a digit. So an id is never "." or "..", and never looks like a
// command-line option.
bool IsResourceId(std::string_view id);
// The rule of IsResourceId, for error messages.
inline constexpr char kResourceIdRule[] =
    "must be 1 to 63 of a-z, A-Z, 0-9, '_', '.' and '-', beginning with a letter or a digit";

}  // namespace pepeseg
