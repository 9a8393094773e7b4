/* What the C tests ask for, with the line and the last error where it does not hold. */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition)                                                               \
  do {                                                                                 \
    if (!(condition)) {                                                                \
      fprintf(stderr, "line %d: %s (%s)\n", __LINE__, #condition, fclib_last_error()); \
      exit(1);                                                                         \
    }                                                                                  \
  } while (0)
#define SAYS(text) CHECK(strstr(fclib_last_error(), text))
