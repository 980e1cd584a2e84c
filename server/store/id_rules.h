#pragma once

#include <string_view>

// Which ids clients may choose.
namespace pepeseg {

// Ids of projects: 1 to 63 lower-case letters, digits and '-', from a letter to no '-'.
bool IsRfc1034Label(std::string_view id);

// Ids of scenes and labels: 1 to 63 letters, digits, '_', '.' and '-' of ASCII, beginning with a
// letter or a digit. So none is "." or "..", or looks like an option.
bool IsResourceId(std::string_view id);
inline constexpr char kResourceIdRule[] =
    "must be 1 to 63 of a-z, A-Z, 0-9, '_', '.' and '-', beginning with a letter or a digit";

}  // namespace pepeseg
