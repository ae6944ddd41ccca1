# What campaigns compile beside the node of an export: included by its CMakeLists with SLIP_VIC_MORE.
add_library(beside SHARED ${CMAKE_CURRENT_LIST_DIR}/faults/beside.cpp)
target_link_libraries(beside PRIVATE slip_vic_session)
add_executable(floor ${CMAKE_CURRENT_LIST_DIR}/bench/floor.cpp)
target_include_directories(floor PRIVATE node)
target_include_directories(floor SYSTEM PRIVATE ${ROS_FOLDERS})
target_link_libraries(floor PRIVATE ${LIBRARIES})
target_link_options(floor PRIVATE -Wl,--allow-shlib-undefined -Wl,--disable-new-dtags)
set_target_properties(beside floor PROPERTIES ENABLE_EXPORTS ON PREFIX ""
  BUILD_RPATH "${ROS_LIBRARIES};${PINOCCHIO_LIBRARIES};${BESIDE}")
set_target_properties(floor PROPERTIES OUTPUT_NAME slip_vic_node
  RUNTIME_OUTPUT_DIRECTORY "${CMAKE_SOURCE_DIR}/floor/build")
