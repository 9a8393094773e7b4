! What the Fortran module promises; ends with 0 where it holds: fortran FOLDER.
module hearing
  use, intrinsic :: iso_c_binding
  use fclib, only: fclib_text
  implicit none
  integer :: told = 0

contains

  subroutine hear(message, context) bind(c)
    type(c_ptr), value :: message, context
    if (.not. c_associated(context) .and. fclib_text(message) /= "") told = told + 1
  end subroutine

end module

program checks
  use, intrinsic :: iso_c_binding
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: error_unit
  use fclib
  use hearing
  implicit none

  integer, parameter :: dp = c_double
  character(500) :: folder

  call get_command_argument(1, folder)
  call fclib_set_error_handler(c_null_funptr, c_null_ptr)
  call matrices
  call words
  call sliding_ball
  call all_kinds
  call bodies
  call steps
  call failures
  call lengths
  call check(fclib_solver(1) /= "", "there is a solver")
  call check(fclib_solver(1000) == "" .and. fclib_solver(0) == "", "and not any number of them")
  call check(fclib_status_text(FCLIB_INACCURATE) == "inaccurate", "statuses have names")

contains

  subroutine check(condition, what)
    logical, intent(in) :: condition
    character(*), intent(in) :: what
    if (condition) return
    write (error_unit, "(5a)") "not so: ", what, " (", fclib_error(), ")"
    stop 1
  end subroutine

  function path_of(name) result(path)
    character(*), intent(in) :: name
    character(:), allocatable :: path
    path = trim(folder) // "/" // name
  end function

  ! ---- arrays and texts into the structs and out of them

  subroutine matrices
    type(fclib_local) :: problem
    type(fclib_matrix) :: a
    real(dp) :: dense(2, 3), conditioning
    integer, allocatable :: i(:), j(:)
    real(dp), allocatable :: x(:)
    real(dp), pointer :: view(:)
    integer(c_int), pointer :: indices(:)
    integer :: rank
    dense = reshape([1, 2, 0, 4, 5, 0] * 1._dp, [2, 3])

    call fclib_set_dense(problem%W, dense)
    call check(all(fclib_get_dense(problem%W) == dense), "dense")
    a = fclib_get_matrix(problem%W)
    call check(a%m == 2 .and. a%n == 3 .and. a%nz == FCLIB_DENSE, "sizes")

    call fclib_set_columns(problem%W, 2, 3, [1, 3, 4, 5], [1, 2, 2, 1], [1, 2, 4, 5] * 1._dp)
    call check(all(fclib_get_dense(problem%W) == dense), "columns")
    a = fclib_get_matrix(problem%W)
    indices => fclib_indices(a%p, 4)
    call check(all(indices == [0, 2, 3, 4]), "pointers begin with 0 in the struct")

    call fclib_set_rows(problem%W, 2, 3, [1, 3, 5], [1, 3, 1, 2], [1, 5, 2, 4] * 1._dp)
    call check(all(fclib_get_dense(problem%W) == dense), "rows")
    call fclib_get_triplets(problem%W, i, j, x)
    call check(all(i == [1, 1, 2, 2]) .and. all(j == [1, 3, 1, 2]), "the places of entries")

    call fclib_set_triplets(problem%W, 2, 3, [1, 2, 2, 1, 1], [1, 1, 2, 3, 3], &
                            [1, 2, 4, 3, 2] * 1._dp)
    call check(all(fclib_get_dense(problem%W) == dense), "triplets add up")
    call fclib_get_triplets(problem%W, i, j, x)
    call check(size(x) == 5 .and. i(2) == 2 .and. j(2) == 1, "triplets stay triplets")
    a = fclib_get_matrix(problem%W)
    view => fclib_vector(a%x, a%nz)
    view(1) = 7
    dense(1, 1) = 7
    call check(all(fclib_get_dense(problem%W) == dense), "a view is no copy")

    call fclib_set_dense(problem%V, reshape([real(dp) ::], [0, 4]))
    call check(size(fclib_get_dense(problem%V), 2) == 4, "no rows")
    call check(size(fclib_get_dense(problem%R)) == 0, "no matrix")

    call check(.not. fclib_get_matrix_info(problem%W), "nothing is known")
    call fclib_set_matrix_info(problem%W, conditioning=2._dp)
    call fclib_set_matrix_info(problem%W, comment="a comment", conditioning=3._dp, rank=2)
    block
      character(:), allocatable :: comment
      call check(fclib_get_matrix_info(problem%W, comment, conditioning, rank=rank), "known")
      call check(comment == "a comment" .and. conditioning == 3 .and. rank == 2, "what is known")
    end block

    call fclib_set(problem%mu, [0.5_dp])
    call fclib_set(problem%mu, [0.25_dp, 0.75_dp])
    view => fclib_vector(problem%mu, 2)
    call check(all(view == [0.25_dp, 0.75_dp]), "vectors")
    view => fclib_vector(problem%mu, 1)
    call fclib_set(problem%mu, view)
    view => fclib_vector(problem%mu, 1)
    call check(view(1) == 0.25_dp, "a part of what is replaced")
    call check(size(fclib_vector(problem%q, 5)) == 0, "no vector")
    call fclib_delete(problem)
    call check(.not. c_associated(problem%W) .and. .not. c_associated(problem%mu), "deleted")
    call fclib_delete(problem)
  end subroutine

  subroutine words
    type(fclib_local) :: problem
    character(:), allocatable :: title, description, math_info
    call fclib_get_info(problem%info, title, description)
    call check(title == "" .and. description == "", "no words")
    call fclib_set_info(problem%info, title="a title", math_info="")
    call fclib_set_info(problem%info, title="another title  ", math_info="")
    call fclib_get_info(problem%info, title, description, math_info)
    call check(title == "another title" .and. description == "" .and. math_info == "", "words")
    call check(fclib_text(c_null_ptr) == "", "no text")
    call fclib_delete(problem)
  end subroutine

  ! ---- problems

  subroutine one_contact(contacts, size_of_contact)
    type(c_ptr), intent(inout) :: contacts
    integer, intent(in) :: size_of_contact
    integer :: k
    call fclib_set_triplets(contacts, size_of_contact, size_of_contact, &
                            [(k, k=1, size_of_contact)], [(k, k=1, size_of_contact)], &
                            [(1._dp, k=1, size_of_contact)])
  end subroutine

  subroutine sliding_ball
    type(fclib_local) :: problem, again
    type(fclib_solution) :: solution, other
    type(fclib_solution), allocatable :: guesses(:)
    type(fclib_solve_result) :: result
    real(dp), pointer :: r(:), u(:)
    real(dp) :: y(1)
    integer :: n, m, p, nc
    character(:), allocatable :: path
    path = path_of("local.hdf5")
    call one_contact(problem%W, 3)
    call fclib_set(problem%q, [-1._dp, 2._dp, 0._dp])
    call fclib_set(problem%mu, [0.5_dp])
    call fclib_get_sizes(problem, n, m, p, nc)
    call check(all([n, m, p, nc] == [0, 3, 0, 1]), "the sizes of a problem")
    call check(fclib_validate(problem), "the problem is valid")

    call fclib_allocate(solution, problem)
    call check(fclib_validate(problem, solution), "zero is a solution of the right size")
    call check(fclib_merit(problem, MERIT_2, solution) > 0.1, "and a wrong one")
    call check(fclib_solve(problem, "nsgs", solution, result, tolerance=1e-12_dp, &
                           max_iterations=100, time_limit=10._dp, options="relaxation=1"), "solve")
    call check(result%status == FCLIB_CONVERGED, "it converged")
    r => fclib_vector(solution%r, m)
    u => fclib_vector(solution%u, m)
    call check(all(abs(r - [1._dp, -0.5_dp, 0._dp]) < 1e-11), "the reaction")
    call check(all(abs(u - [0._dp, 1.5_dp, 0._dp]) < 1e-11), "the velocity")
    call check(fclib_merit(problem, MERIT_1, solution) < 1e-11, "the merit of libfclib")
    call fclib_allocate(other, problem)
    call check(fclib_solve(problem, "nsgs", other, guess=solution), "with a guess, and no more")
    y = -1
    call check(fclib_solve(problem, "auto", other, certificate_y=y), "with room for a certificate")
    call check(all(y == -1._dp) .and. fclib_certificate(problem, [1._dp]) == 0, "there is none")

    block
      type(fclib_local) :: nothing
      call check(ieee_is_nan(fclib_certificate(nothing, [1._dp])), "a problem without a matrix")
      call check(index(fclib_error(), "W") > 0, "the matrix is named")
    end block

    call check(fclib_write(problem, path), "write")
    call check(.not. fclib_write(problem, path), "it is there already")
    call check(index(fclib_error(), "already") > 0, "and that is said")
    call check(fclib_write(solution, path), "write a solution")
    call check(fclib_write([solution, other], path), "write guesses")
    call check(fclib_kind(path) == "local", "the kind")
    call check(fclib_create_int_attributes_in_info(path // c_null_char, "n" // c_null_char, 1) == 1, &
               "an attribute")
    call fclib_delete(other)
    call check(fclib_read(path, again), "read")
    call check(fclib_read(path, other), "read the solution")
    call check(fclib_merit(again, MERIT_2, other) < 1e-11, "its merit")
    call check(fclib_read(path // "   ", guesses), "blanks at the end of a path are none of it")
    call check(size(guesses) == 2, "the guesses")
    call check(fclib_merit(again, MERIT_2, guesses(1)) < 1e-11, "the merit of the first")
    call fclib_delete(guesses)
    call fclib_delete(other)
    call fclib_delete(again)
    call fclib_delete(solution)
    call fclib_delete(problem)
  end subroutine

  subroutine all_kinds
    type(fclib_global) :: global
    type(fclib_global_rolling) :: global_rolling
    type(fclib_local_rolling) :: local_rolling
    type(fclib_local_spin) :: local_spin
    type(fclib_solution) :: solution
    integer :: k, n, m, p, nc

    call one_contact(global%M, 3)
    call one_contact(global%H, 3)
    call fclib_set_dense(global%G, reshape([0._dp, 1._dp, 0._dp], [3, 1]))
    call fclib_set(global%f, [-1._dp, 2._dp, 0._dp])
    call fclib_set(global%w, [(0._dp, k=1, 3)])
    call fclib_set(global%b, [0._dp])
    call fclib_set(global%mu, [0.5_dp])
    call fclib_get_sizes(global, n, m, p, nc)
    call check(all([n, m, p, nc] == [3, 3, 1, 1]), "the sizes of a global problem")
    call fclib_allocate(solution, global)
    call check(fclib_solve(global, "nsgs", solution), "solve a global problem")
    call check(fclib_merit(global, MERIT_2, solution) < 1e-8, "its merit")
    call check(fclib_write(global, path_of("global.hdf5")), "write a global problem")
    call check(fclib_write(solution, path_of("global.hdf5")), "and its solution")
    call fclib_delete(global)
    call fclib_delete(solution)
    call check(fclib_read(path_of("global.hdf5"), global), "read a global problem")
    call check(fclib_read(path_of("global.hdf5"), solution), "and its solution")
    call check(fclib_validate(global, solution), "both are valid")
    call fclib_delete(solution)
    call fclib_delete(global)

    call one_contact(local_rolling%W, 5)
    call fclib_set(local_rolling%q, [-1._dp, 2._dp, 0._dp, 1._dp, 0._dp])
    call fclib_set(local_rolling%mu, [0.5_dp])
    call fclib_set(local_rolling%mu_r, [0.1_dp])
    call fclib_allocate(solution, local_rolling)
    call check(fclib_solve(local_rolling, "nsgs", solution), "solve a rolling problem")
    call check(fclib_merit(local_rolling, MERIT_2, solution) < 1e-8, "its merit")
    call check(fclib_write(local_rolling, path_of("rolling.hdf5")), "write a rolling problem")
    call fclib_delete(local_rolling)
    call check(fclib_read(path_of("rolling.hdf5"), local_rolling), "read a rolling problem")
    call check(fclib_validate(local_rolling, solution), "it is valid")
    call fclib_delete(solution)
    call fclib_delete(local_rolling)

    call one_contact(local_spin%W, 4)
    call fclib_set(local_spin%q, [-1._dp, 2._dp, 0._dp, 1._dp])
    call fclib_set(local_spin%mu, [0.5_dp])
    call fclib_set(local_spin%mu_s, [0.1_dp])
    local_spin%coupled = 1
    call fclib_allocate(solution, local_spin)
    call check(fclib_solve(local_spin, "nsgs", solution), "solve a problem with spin")
    call check(fclib_merit(local_spin, MERIT_2, solution) < 1e-8, "its merit")
    call check(fclib_write(local_spin, path_of("spin.hdf5")), "write a problem with spin")
    call fclib_delete(local_spin)
    call check(fclib_read(path_of("spin.hdf5"), local_spin), "read a problem with spin")
    call check(local_spin%coupled == 1, "its law")
    call check(fclib_validate(local_spin, solution), "it is valid")
    call fclib_delete(solution)
    call fclib_delete(local_spin)

    call one_contact(global_rolling%M, 5)
    call one_contact(global_rolling%H, 5)
    call fclib_set(global_rolling%f, [-1._dp, 2._dp, 0._dp, 1._dp, 0._dp])
    call fclib_set(global_rolling%w, [(0._dp, k=1, 5)])
    call fclib_set(global_rolling%mu, [0.5_dp])
    call fclib_set(global_rolling%mu_r, [0.1_dp])
    call check(fclib_write(global_rolling, path_of("both.hdf5")), "write a global rolling problem")
    call fclib_delete(global_rolling)
    call check(fclib_read(path_of("both.hdf5"), global_rolling), "read it")
    call check(fclib_kind(path_of("both.hdf5")) == "global_rolling", "its kind")
    call fclib_get_sizes(global_rolling, n, m, p, nc)
    call check(all([n, m, p, nc] == [5, 5, 0, 1]), "its sizes")
    call fclib_delete(global_rolling)
  end subroutine

  ! ---- where bodies are, what they weigh and how they move

  ! a ball of 2 kg above the ground; the arrays are the caller's
  subroutine bodies
    type(fclib_local) :: problem
    type(fclib_geometry) :: geometry
    integer(c_int), target :: body(2, 1), moves(2), kinds(2)
    real(dp), target :: point(3, 1), normal(3, 1), tangent(3, 1), place(3, 2), sizes(3, 2), mass(2)
    real(dp), target :: inertia(3, 2), center(3, 2), axes(4, 2), velocity(6), impulse(6)
    character(kind=c_char, len=7), target :: names(2), unit
    type(c_ptr), target :: name(2)
    character(:), allocatable :: path
    integer :: k
    path = path_of("bodies.hdf5") // c_null_char
    body(:, 1) = [0, 1]
    point(:, 1) = [0, 0, 0]
    normal(:, 1) = [0, 0, 1]
    tangent(:, 1) = [1, 0, 0]
    moves = [0, 1]
    place = reshape([0, 0, 0, 3, 4, 5] * 1._dp, [3, 2])
    kinds = [FCLIB_PLANE, FCLIB_SPHERE]
    sizes = reshape([0, 0, 0, 5, 0, 0] * 1._dp, [3, 2])
    mass = [0, 2]
    inertia = reshape([0, 0, 0, 7, 8, 9] * 1._dp, [3, 2])
    center = reshape([0, 0, 0, 1, 2, 3] * 0.125_dp, [3, 2])
    axes = reshape([1, 0, 0, 0, 0, 1, 0, 0] * 1._dp, [4, 2])
    velocity = [1, 2, 3, 4, 5, 6]
    impulse = -0.5_dp * velocity
    names = ["ground" // c_null_char, "ball" // c_null_char // "  "]
    unit = "mm" // c_null_char
    name = [(c_loc(names(k)), k=1, 2)]

    geometry%nc = 1
    geometry%body = c_loc(body)
    geometry%point = c_loc(point)
    geometry%normal = c_loc(normal)
    geometry%tangent = c_loc(tangent)
    geometry%nb = 2
    geometry%name = c_loc(name)
    geometry%moves = c_loc(moves)
    geometry%place = c_loc(place)
    geometry%ns = 2
    geometry%shape_kind = c_loc(kinds)
    geometry%shape_size = c_loc(sizes)
    geometry%unit = c_loc(unit)
    geometry%mass = c_loc(mass)
    geometry%inertia = c_loc(inertia)
    geometry%center = c_loc(center)
    geometry%axes = c_loc(axes)
    geometry%n = 6
    geometry%velocity = c_loc(velocity)
    geometry%impulse = c_loc(impulse)

    call falling(problem)
    call check(fclib_write(problem, path_of("bodies.hdf5")), "the problem of the bodies")
    call check(fclib_write_geometry(geometry, path) == 0, "the size of the struct is missing")
    call check(index(fclib_error(), "geometry->size") > 0, "and that is said")
    geometry%size = c_sizeof(geometry)
    velocity(6) = ieee_value(0._dp, ieee_quiet_nan)
    call check(fclib_write_geometry(geometry, path) == 0, "a velocity that is no number")
    call check(index(fclib_error(), "/bodies/velocity[5]") > 0, "which is told")
    velocity(6) = 6
    call check(fclib_write_geometry(geometry, path) == 1, "write the bodies")
    call check(fclib_write_geometry(geometry, path) == 0, "they are there already")
    call fclib_delete(problem)
  end subroutine

  ! the ball touches, and its speed down is 1
  subroutine falling(problem)
    type(fclib_local), intent(inout) :: problem
    call one_contact(problem%W, 3)
    call fclib_set(problem%q, [-1._dp, 0._dp, 0._dp])
    call fclib_set(problem%mu, [0.5_dp])
  end subroutine

  ! ---- many problems in one file

  subroutine steps
    type(fclib_local) :: problem, again
    type(fclib_solution) :: solution, other
    type(c_ptr) :: sequence
    real(dp), pointer :: q(:)
    character(:), allocatable :: path
    integer :: k
    path = path_of("steps.h5")
    call falling(problem)
    call fclib_allocate(solution, problem)
    q => fclib_vector(problem%q, 3)
    sequence = fclib_sequence_create(path // c_null_char, c_null_ptr)
    call check(c_associated(sequence), "a sequence")
    do k = 1, 3
      q(1) = -k
      call check(fclib_solve(problem, "nsgs", solution), "solve a step")
      call check(fclib_sequence_add_local(sequence, problem, 0) == 1, "add a step")
      call check(fclib_sequence_add_solution(sequence, solution) == 1, "add its solution")
    end do
    call check(fclib_sequence_flush(sequence) == 1, "confirm")
    call check(fclib_sequence_size(path // c_null_char) == 3, "three steps")
    call check(fclib_sequence_close(sequence) == 1, "close")
    call check(fclib_read(path // "#2", again), "read the last step")
    call check(fclib_read(path // "#2", other), "and its solution")
    q => fclib_vector(again%q, 3)
    call check(q(1) == -3, "it is the last one")
    call check(fclib_merit(again, MERIT_2, other) < 1e-8, "solved")
    call fclib_delete(other)
    call fclib_delete(solution)
    call fclib_delete(again)
    call fclib_delete(problem)
  end subroutine

  ! ---- what goes wrong

  subroutine failures
    type(fclib_local) :: problem
    type(fclib_solution) :: solution
    type(fclib_solution), allocatable :: guesses(:)
    character(:), allocatable :: missing
    real(dp) :: error
    missing = path_of("missing.hdf5")
    call fclib_set_error_handler(c_funloc(hear), c_null_ptr)
    call check(.not. fclib_read(missing, problem), "no problem")
    call check(fclib_error() == missing // ": there is no such file", "the message")
    call check(.not. fclib_read(missing, solution), "no solution")
    call check(.not. fclib_read(missing, guesses), "no guesses")
    call check(.not. allocated(guesses), "none at all")
    call check(fclib_kind(missing) == "", "no kind")
    call check(.not. fclib_write(solution, missing), "nothing to write to")
    call check(.not. fclib_validate(problem), "an empty problem")
    call check(fclib_error() == "/fclib_local/W: is NULL", "what is wrong with it")
    error = fclib_merit(problem, MERIT_2, solution)
    call check(error /= error, "its merit")
    call check(.not. fclib_solve(problem, "nsgs", solution), "it is not solved")
    call check(fclib_set_compression(10) == 0 .and. fclib_set_compression(4) == 1, "levels")
    call check(told == 9, "the handler hears of each")
    call fclib_set_error_handler(c_null_funptr, c_null_ptr)
  end subroutine

  ! arrays whose lengths do not fit

  subroutine lengths
    type(fclib_local) :: problem
    type(fclib_solution) :: solution
    real(dp) :: x(3) = 1, y(3) = -1, bound
    integer :: one(3) = [1, 2, 3]
    logical :: ok
    call falling(problem)
    call fclib_allocate(solution, problem)

    call fclib_set_triplets(problem%W, 3, 3, one(:2), one, x, ok)
    call check(.not. ok, "too few rows")
    call says("fclib_set_triplets: i has 2 entries, expected 3")
    call check(.not. fclib_validate(problem), "no call takes the matrix")
    call says("/fclib_local/W/nz: -4 is no storage")
    call check(.not. fclib_solve(problem, "nsgs", solution), "nor a solve")
    call fclib_set_triplets(problem%W, 3, 3, one, one(:1), x)
    call says("fclib_set_triplets: j has 1 entries, expected 3")
    call fclib_set_columns(problem%W, 3, 3, one, one, x)
    call says("fclib_set_columns: starts has 3 entries, expected 4")
    call fclib_set_columns(problem%W, 3, 3, [one, 4], one(:2), x)
    call says("fclib_set_columns: i has 2 entries, expected 3")
    call fclib_set_rows(problem%W, 3, 3, [one, 4, 4], one, x)
    call says("fclib_set_rows: starts has 5 entries, expected 4")
    call fclib_set_rows(problem%W, 3, 3, [one, 4], one, x(:2))
    call says("fclib_set_rows: j has 3 entries, expected 2")
    call fclib_set_rows(problem%W, 3, 3, [one, 4], one, x, ok)
    call check(ok .and. fclib_validate(problem), "lengths that fit")

    call check(.not. fclib_solve(problem, "auto", solution, certificate_y=y), "y is too long")
    call says("fclib_solve: certificate_y has 3 entries, expected 1")
    call check(.not. fclib_solve(problem, "auto", solution, certificate_y=y(:0)), "and too short")
    call check(.not. fclib_solve(problem, "auto", solution, certificate_y=y(:1), certificate_z=y), &
               "z is too long")
    call says("fclib_solve: certificate_z has 3 entries, expected 0")
    call check(all(y == -1._dp), "nothing is written")
    bound = fclib_certificate(problem, y(:0))
    call check(bound /= bound, "nothing is proven by too few numbers")
    call says("fclib_certificate: y has 0 entries, expected 1")
    bound = fclib_certificate(problem, y(:1), y)
    call check(bound /= bound, "nor by too many")
    call says("fclib_certificate: z has 3 entries, expected 0")
    call fclib_delete(solution)
    call fclib_delete(problem)
  end subroutine

  subroutine says(message)
    character(*), intent(in) :: message
    call check(fclib_error() == message, message)
  end subroutine

end program
