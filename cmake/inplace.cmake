# The extension and its stub beside the Python sources, at every build, and a line that makes Python
# look there: what is edited is what is imported, new modules too, with no import hook.
set(inplace ${CMAKE_CURRENT_SOURCE_DIR}/python/fclib)
get_target_property(suffix _core SUFFIX)
# a process that runs keeps the extension it has loaded: another file takes its name
add_custom_command(
  OUTPUT ${inplace}/_core${suffix}
  COMMAND ${CMAKE_COMMAND} -E copy $<TARGET_FILE:_core> ${inplace}/_core${suffix}.new
  COMMAND ${CMAKE_COMMAND} -E rename ${inplace}/_core${suffix}.new ${inplace}/_core${suffix}
  DEPENDS _core VERBATIM)
add_custom_command(
  OUTPUT ${inplace}/_core.pyi
  COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_CURRENT_BINARY_DIR}/_core.pyi ${inplace}/_core.pyi
  DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/_core.pyi _core_stub VERBATIM)
add_custom_target(fclib_inplace ALL DEPENDS ${inplace}/_core${suffix} ${inplace}/_core.pyi)

file(CONFIGURE OUTPUT ${generated}/fclib-sources.pth
     CONTENT "${CMAKE_CURRENT_SOURCE_DIR}/python\n" @ONLY)
install(FILES ${generated}/fclib-sources.pth DESTINATION . COMPONENT python)
