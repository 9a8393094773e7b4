! Builds a problem, writes it, reads it, solves it and judges the solution: ball FILE.
!
! A ball of 1 kg falls on a plane while it slides: it stops falling, and friction slows it.
program ball
  use, intrinsic :: iso_c_binding, only: c_double
  use, intrinsic :: iso_fortran_env, only: error_unit
  use fclib
  implicit none

  type(fclib_local) :: problem, again
  type(fclib_solution) :: solution
  type(fclib_solve_result) :: result
  real(c_double), pointer :: r(:)
  real(c_double) :: identity(3, 3)
  character(1000) :: path
  integer :: m, nc, status, k

  call get_command_argument(1, path, status=status)
  if (status /= 0) then
    write (error_unit, "(a)") "usage: ball FILE"
    stop 2
  end if

  ! u = W r + q, with W = 1 / mass
  identity = reshape([(merge(1._c_double, 0._c_double, mod(k, 4) == 0), k=0, 8)], [3, 3])
  problem%spacedim = 3
  call fclib_set_dense(problem%W, identity)
  call fclib_set_matrix_info(problem%W, comment="1 / mass", conditioning=1._c_double, &
                             determinant=1._c_double, rank=3)
  call fclib_set(problem%q, [-1._c_double, 2._c_double, 0._c_double])
  call fclib_set(problem%mu, [0.5_c_double])
  call fclib_set_info(problem%info, title="a ball on a plane", description="one contact, sliding")
  if (.not. fclib_validate(problem)) call fail("the problem")

  ! the file may be there from the last time
  if (fclib_set_write_mode(FCLIB_WRITE_REPLACE) == 0) call fail("the mode")
  if (.not. fclib_write(problem, path)) call fail("writing")

  if (.not. fclib_read(path, again)) call fail("reading")
  call fclib_get_sizes(again, m=m, nc=nc)
  block
    character(:), allocatable :: title
    call fclib_get_info(again%info, title=title)
    print "(4a, i0)", title, ", ", fclib_kind(path), ", contacts: ", nc
  end block

  call fclib_allocate(solution, again)
  if (.not. fclib_solve(again, fclib_solver(1), solution, result, tolerance=1e-10_c_double)) &
    call fail("solving")
  r => fclib_vector(solution%r, m)
  print "(2a, i0, a)", fclib_status_text(result%status), " after ", result%iterations, " iterations"
  print "(a, *(f7.3))", "r =", r
  print "(a, es8.1)", "merit", fclib_merit(again, MERIT_2, solution)
  if (.not. fclib_write(solution, path)) call fail("writing")

  call fclib_delete(solution)
  call fclib_delete(again)
  call fclib_delete(problem)

contains

  subroutine fail(what)
    character(*), intent(in) :: what
    write (error_unit, "(2a)") what, " failed" ! the library has said why
    stop 1
  end subroutine

end program
